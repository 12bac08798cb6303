"""The words sent to a language model, made from templates. Pure functions: types in, types out.

Two styles. `free` is a conversation for strong models, in the manner of Eureka (arXiv 2310.12931): source and state
table of the task, then each earlier program followed by its feedback. `grammar` is for the embedded model: a compact
table, three worked examples, only the parents as turns, and an answer that begins with the function's signature and
goes on as the typed grammar allows.

What programs, models and trainings wrote is data: it is cleaned and capped before it enters a prompt.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from importlib.resources import files

from ..llm import grammar
from ..numbers import scored
from ..reward import extract, surface
from ..score import breach
from ..text import plain
from ..types import (
    Evaluation,
    Message,
    Opinion,
    Prompt,
    PromptPlan,
    Scored,
    StateVar,
    Style,
    TaskContext,
    TrainingState,
    Verdict,
)
from .reflection import faults

MAX_PROGRAM = 12_000
"""Characters of an earlier program that a prompt shows."""
MAX_FEEDBACK = 8_000
MAX_BRIEF_FEEDBACK = 2_000
"""Characters of feedback for the embedded model, whose context is small."""
MAX_REASONS = 8
MAX_SIBLINGS, MAX_TERMS, MAX_TERM = 15, 10, 30
"""Other rewards of a generation that a prompt lists, terms of each, and characters of a term's name."""
MAX_WORDS = 4_000
"""Characters of what a person said; the embedded model is shown half of it."""
ROOM = 50
"""Characters of these that a remark leaves free for the marks before its lines, so that a cut one fits whole."""
MAX_REJECTED = 2
"""Rejected programs that a prompt shows, the newest ones."""

_CUT = "\n[...]\n"
_USES = {
    "raw": "",
    "zero_centred": ", best near 0",
    "directional": ", a quantity",
    "point": ", a point",
}


def render(context: TaskContext, plan: PromptPlan, style: Style, *, progress: bool = False) -> Prompt:
    """The prompt of a plan.

    Args:
        progress: whether rewards may say how far an episode has come, which `bonus=progress` pays for.

    Raises:
        TaskError: if the style is `grammar` and the task marks no variable for it.
    """
    write = _free if style == "free" else _grammar
    return write(context, plan, progress)


def repair(prompt: Prompt, reply: str, verdict: Verdict) -> Prompt:
    """The prompt, then the refused program, which the findings' line numbers refer to, and why it was refused. If a
    reply has no program, its text after the thoughts is shown instead."""
    program = extract.program(reply)
    if program is not None:
        shown = extract.fenced(clean(program, MAX_PROGRAM).strip())
    else:
        shown = clean(extract.answer(reply).strip() or reply, MAX_PROGRAM)
    findings = "\n".join(f"- {finding.sentence()}" for finding in verdict.findings[:MAX_REASONS])
    request = template("repair").format(findings=clean(findings or f"- {verdict.code}", MAX_FEEDBACK))
    return asked_again(prompt, shown, request)


def asked_again(prompt: Prompt, shown: str, request: str) -> Prompt:
    """The prompt, then what is shown of a reply to it, and the next request."""
    said = shown.strip() or "(nothing)"  # endpoints refuse an empty turn, and would again after every resume
    turn = (Message("assistant", said), Message("user", request))
    return replace(prompt, messages=(*prompt.messages, *turn))


def clean(text: str, limit: int) -> str:
    """Plain text of at most about `limit` characters.

    The middle of a longer text is cut out: mistakes are named at the end of a text as often as at its beginning.
    """
    if len(text) > limit:
        text = text[: limit // 2] + _CUT + text[-(limit // 2) :]
    return plain(text)


def _free(context: TaskContext, plan: PromptPlan, progress: bool) -> Prompt:
    system = template("free_system").format(
        signature=", ".join(f"{v.name}: {_annotation(v)}" for v in context.state.variables[:2]) + ", ...",
        torch=_words(surface.TORCH - surface.DTYPES),
        functional=_words(surface.FUNCTIONAL),
        helpers=_words(surface.HELPERS),
        progress=template("free_progress") if progress else "",
        ends=template("free_ends") if plan.informed else "",
        most=surface.MAX_COMPONENTS,
    )
    task = template("free_task").format(
        description=context.description,
        source=template("free_documents" if context.documented else "free_source").format(
            source=context.source.strip()
        ),
        variables="\n".join(f"- `{v.name}`: {_annotation(v)}{_shape(v)}. {v.meaning}" for v in context.state.variables),
        facts="\n".join(["What else there is to know:", *facts(context)]) + "\n\n" if plan.informed else "",
    )
    turns = [message for turn in plan.turns for message in _turn(turn, plan, "free", context.score_range[1])]
    messages = _with_notes((Message("system", system), Message("user", task), *turns), plan)
    return Prompt(messages=_with_opinion(messages, plan.opinion, MAX_WORDS, MAX_REJECTED))


def _grammar(context: TaskContext, plan: PromptPlan, progress: bool) -> Prompt:
    task = template("grammar_task").format(
        description=context.description,
        variables="\n".join(
            f"- {v.name}{_shape(v)}: {v.meaning}{_USES[v.use]}" for v in grammar.offered(context.state)
        ),
    )
    rules = template("grammar_system") + (template("grammar_progress") if progress else "")
    system = f"{rules}\n{template('grammar_examples')}"
    # Parents only: the newest is the best reward, and a longer prompt takes memory for each of the parallel samples.
    shown = plan.turns[-2:] if plan.crossover else plan.turns[-1:]
    turns = [message for turn in shown for message in _turn(turn, plan, "grammar", context.score_range[1])]
    messages = _with_notes((Message("system", system), Message("user", task), *turns), plan)
    return Prompt(
        messages=_with_opinion(messages, plan.opinion, MAX_WORDS // 2, rejected=0),
        grammar=grammar.grammar(context.state, progress=progress),
        prefill=grammar.prefill(context.state),
    )


def _turn(turn: Scored, plan: PromptPlan, style: Style, highest: float | None) -> tuple[Message, ...]:
    """An earlier answer and the feedback on it; `highest` is the highest possible score."""
    candidate = turn.sample.candidate
    program = clean(candidate.source, MAX_PROGRAM).strip() if candidate is not None else ""
    feedback = template(f"{style}_feedback").format(
        score=_score(turn, plan, style, highest) if plan.informed else "",
        feedback=clean(turn.feedback, MAX_FEEDBACK if style == "free" else MAX_BRIEF_FEEDBACK),
        siblings=_siblings(plan) if turn is plan.turns[-1] else "",
        tips=template("free_tips") if turn is plan.turns[-1] else "",
    )
    return Message("assistant", extract.fenced(program)), Message("user", feedback)


def _score(turn: Scored, plan: PromptPlan, style: Style, highest: float | None) -> str:
    """One line on how high a shown reward scores, whether it is the best and whether it is the one to improve; and one
    on the episodes that its policy played."""
    if turn.played is not None:
        episodes = f" in {turn.played.episodes} episodes" if style == "free" else ""
        scores = f"Its policy, played{episodes} after training, scores {with_error(turn.played)}"
    elif turn.score is not None:
        scores = f"Its policy scored {turn.score:.4g} at best during training"
    else:
        scores = "The score of its policy is undefined"
    lasted = f"{_lasted(turn.played)}\n" if turn.played is not None and turn.played.episodes else ""
    rank = _rank(turn, plan)
    if style == "grammar":
        return f"{scores}, {rank}.\n{lasted}"
    if turn is not plan.turns[-1] or plan.crossover:
        rank += "."
    elif plan.opinion.chosen and not _best(turn, plan):
        rank += ", but the choice of a person. This is the one to improve."
    else:
        rank += ". This is the one to improve."
        if _counts(turn, plan) and highest is not None and (turn.score or 0.0) >= highest:
            rank += " No score is higher: what is left is to learn it sooner, and with any seed."
    told = turn is plan.turns[-1] and "±" in scores
    meaning = "; ± is the standard error over these episodes, of one training" if told else ""
    generation = f"A reward function of generation {turn.sample.generation}."
    return f"{generation} {scores} (higher is better{meaning}): {rank}\n{lasted}\n"


def _rank(turn: Scored, plan: PromptPlan) -> str:
    """How a shown reward compares with the best."""
    votes = " by the votes of a person" if plan.opinion.by_votes else ""
    if plan.best is None and plan.limits:
        return "no policy keeps the limits so far"
    if _best(turn, plan):
        return f"the best of all so far{votes}"
    if plan.best is not None and _counts(turn, plan) and turn.score == plan.best.score:
        return "as good as the best so far"
    return f"not the best so far{votes}"


def _best(turn: Scored, plan: PromptPlan) -> bool:
    return plan.best is not None and plan.best.candidate_id == turn.candidate_id


def _counts(turn: Scored, plan: PromptPlan) -> bool:
    """Whether its score says how good a reward is: it has one, keeps the limits, and no votes decide."""
    return turn.score is not None and not turn.breaks(plan.limits) and not plan.opinion.by_votes


def _lasted(played: Evaluation) -> str:
    """How long a policy's episodes lasted, and how many ended early, which is known of robots on a floating base."""
    early = played.costs.get("falls")
    ended = "" if early is None else f"; {early:.0%} ended early"
    return f"Its episodes lasted {played.episode_length:.0f} steps on average{ended}."


def _siblings(plan: PromptPlan) -> str:
    """A line for each other reward of the parent's generation that trained, best first: score, ending and terms."""
    trained = [entry for entry in plan.siblings if entry.trained and entry.score is not None]
    trained.sort(key=lambda entry: entry.score or 0.0, reverse=True)
    if not trained:
        return ""
    lines = ["The other rewards of its generation, by score and terms:"]
    for entry in trained[:MAX_SIBLINGS]:
        score = with_error(entry.played) if entry.played is not None else f"{entry.score:.4g} in training"
        if entry.result is not None and entry.result.state is TrainingState.CUT:
            score += f", cut {entry.result.message}"
        if broken := breach(entry.played, plan.limits):
            score += f", breaks a limit ({broken})"
        graph = entry.sample.verdict.graph
        names = [clean(name, MAX_TERM) for name, _ in graph.components[:MAX_TERMS]] if graph is not None else []
        terms = ", ".join(" ".join(name.split()) for name in names)
        lines.append(f"- {score}: {terms or 'no terms named'}")
    return "\n".join(lines) + "\n\n"


def with_error(score: Evaluation) -> str:
    """The score of a policy, such as `428 ± 33`, or `undefined`."""
    return "undefined" if score.fitness is None else scored(score)


def scale(unit: str, ends: tuple[float | None, float | None]) -> str:
    """Unit and range of a task's score, as far as the task declares them."""
    low, high = ends
    if low is not None and high is not None:
        bounds = f"from {low:g} to {high:g}"
    elif low is not None:
        bounds = f"at least {low:g}"
    elif high is not None:
        bounds = f"at most {high:g}"
    else:
        bounds = ""
    return ", ".join(part for part in (unit, bounds) if part)


def facts(context: TaskContext) -> list[str]:
    """Lines on unit and range of the score and on what it does not tell; nothing about how it is computed."""
    found = scale(context.score_unit, context.score_range)
    score = f"The task score: {found}; higher is better." if found else "A higher task score is better."
    return [score, *context.facts]


def _with_notes(messages: tuple[Message, ...], plan: PromptPlan) -> tuple[Message, ...]:
    """Adds to the last request that two parents are to be combined, and why nothing trained, each reason once."""
    if plan.crossover:
        messages = _with_postscript(messages, template("crossover"))
    reasons = dict.fromkeys(f"- {fault}" for entry in plan.failures for fault in faults(entry))
    if not reasons:
        return messages
    shown = clean("\n".join(list(reasons)[:MAX_REASONS]), MAX_BRIEF_FEEDBACK)
    return _with_postscript(messages, template("failures").format(reasons=shown))


def _with_opinion(messages: tuple[Message, ...], opinion: Opinion, limit: int, rejected: int) -> tuple[Message, ...]:
    """Adds to the last request what a person said; if that is too much, the newest words are kept."""
    lines: list[str] = []
    if opinion.chosen:
        lines.append("They chose the last reward function above as the one to improve.")
    if opinion.won or opinion.lost:
        lines.append(f"They preferred its policy in {opinion.won} of {opinion.won + opinion.lost} comparisons.")
    if opinion.words:
        cleaned = [clean(words, limit - ROOM).splitlines() for words in opinion.words]
        said = [f"> {line}" for words in cleaned for line in words]
        lines += ["They said, the newest last:", *_newest(said, limit)]
    for entry in opinion.vetoed[-rejected:] if rejected else ():
        program = clean(entry.sample.candidate.source, MAX_BRIEF_FEEDBACK) if entry.sample.candidate else ""
        lines.append(f"They rejected the policy of this reward function:\n{extract.fenced(program.strip())}")
    return _with_postscript(messages, template("person").format(opinion="\n".join(lines))) if lines else messages


def _newest(lines: list[str], limit: int) -> list[str]:
    """The last whole lines that fit into the limit, after a mark if earlier ones are left out."""
    kept: list[str] = []
    for line in reversed(lines):
        limit -= len(line) + 1
        if limit < 0:
            kept.append(_CUT.strip())
            break
        kept.append(line)
    return kept[::-1]


def _with_postscript(messages: tuple[Message, ...], text: str) -> tuple[Message, ...]:
    last = messages[-1]
    return (*messages[:-1], Message(last.role, f"{last.content}\n{text}"))


def _annotation(variable: StateVar) -> str:
    return {"float": "float", "int": "int", "num_envs": "int"}.get(variable.kind, "torch.Tensor")


def _shape(variable: StateVar) -> str:
    """` (N, 3)` for a tensor, nothing for a Python number."""
    if variable.kind not in ("world", "constant"):
        return ""
    sizes = [*(["N"] if variable.kind == "world" else []), *map(str, variable.shape)]
    return f" ({', '.join(sizes)}{',' if len(sizes) == 1 else ''})"


def _words(names: frozenset[str]) -> str:
    return " ".join(sorted(names))


@cache
def template(name: str) -> str:
    """A template's text; a backslash at the end of a line joins it with the next."""
    return (files("openeureka") / "templates" / f"{name}.md").read_text(encoding="utf-8").replace("\\\n", "")
