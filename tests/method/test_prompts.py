"""Golden texts: what is sent, word for word. `EUREKA_GOLDEN=write` renews them; the difference is read in review."""

import os
from dataclasses import replace
from pathlib import Path

import pytest

from openeureka.method import prompts
from openeureka.reward import surface
from openeureka.types import (
    Candidate,
    Evaluation,
    Finding,
    Message,
    Opinion,
    Prompt,
    PromptPlan,
    RewardGraph,
    Sample,
    Scored,
    StateSpec,
    StateVar,
    TaskContext,
    TrainingResult,
    TrainingState,
    Verdict,
    VerdictCode,
)

GOLDEN = Path(__file__).parents[1] / "golden"
CONTEXT = TaskContext(
    env="cartpole",
    description="to balance a pole on a cart so that the pole stays upright",
    state=StateSpec(
        (
            StateVar(name="dof_pos", shape=(2,), meaning="cart position [m], pole angle [rad]"),
            StateVar(name="pole_angle", meaning="pole angle from upright [rad]", use="zero_centred"),
            StateVar(name="tip_position", shape=(3,), meaning="tip of the pole [m]", use="point"),
            StateVar(name="top_position", shape=(3,), meaning="where the tip belongs [m]", use="point"),
            StateVar(name="tip_height", meaning="height of the tip [m]", use="directional"),
            StateVar(name="limits", shape=(2,), kind="constant", meaning="joint limits [rad]"),
            StateVar(name="dt", kind="float", meaning="time between two actions [s]"),
        )
    ),
    source="class Cartpole:\n\n    def observe(self, s):\n        return s['dof_pos']\n",
)
REFUSED = Verdict(
    candidate="x", code=VerdictCode.REFUSED, findings=(Finding(rule="unknown-input", message="no `foo`", line=3),)
)


def entry(source: str, feedback: str, verdict: Verdict = REFUSED) -> Scored:
    candidate = Candidate.of(source)
    return Scored(
        sample=Sample(generation=0, slot=0, candidate=candidate, verdict=verdict), result=None, feedback=feedback
    )


FIRST = entry("def compute_reward(pole_angle):\n    return -pole_angle.abs(), {}\n", "task_score: [1.00, 2.00]")
SECOND = entry("def compute_reward(dof_pos):\n    return dof_pos[:, 1], {}\n", "task_score: [3.00, 4.00]")


def text(prompt: Prompt) -> str:
    parts = [f"=== {message.role} ===\n{message.content}\n" for message in prompt.messages]
    if prompt.grammar is not None:
        parts += [f"=== prefill ===\n{prompt.prefill}\n", f"=== grammar ===\n{prompt.grammar}"]
    return "\n".join(parts)


def golden(path: Path, rendered: str) -> None:
    if os.environ.get("EUREKA_GOLDEN") == "write":
        path.write_text(rendered, encoding="utf-8")
    assert rendered == path.read_text(encoding="utf-8")


@pytest.mark.parametrize("style", ["free", "grammar"])
@pytest.mark.parametrize("turns", [(), (FIRST, SECOND)], ids=["first", "later"])
def test_the_prompt_is_the_golden_one(style, turns):
    path = GOLDEN / f"prompt_{style}_{'later' if turns else 'first'}.md"
    golden(path, text(prompts.render(CONTEXT, PromptPlan(count=4, turns=turns), style)))


def test_the_limit_of_components_and_the_constants_are_told():
    asked = prompts.render(CONTEXT, PromptPlan(count=1), "free").messages[0].content
    assert f"names each term of it (at most {surface.MAX_COMPONENTS})" in asked
    assert "every tensor that the table gives an N; the others are constants" in asked


def test_free_turns_alternate_and_grammar_keeps_the_newest():
    plan = PromptPlan(count=1, turns=(FIRST, SECOND))
    free, grammar = prompts.render(CONTEXT, plan, "free"), prompts.render(CONTEXT, plan, "grammar")
    assert [message.role for message in free.messages] == ["system", "user", "assistant", "user", "assistant", "user"]
    assert [message.role for message in grammar.messages] == ["system", "user", "assistant", "user"]
    assert "dof_pos[:, 1]" in grammar.messages[2].content


def ranked(generation: int, name: str, fitness: float | None, error: float | None = None) -> Scored:
    """A reward with the score of its policy when played."""
    graph = RewardGraph(nodes=(), reward=0, components=((name, 0),))
    verdict = Verdict(candidate=name, code=VerdictCode.ACCEPTED, graph=graph)
    scored = entry(
        f"def compute_reward(pole_angle):\n    return -pole_angle.abs(), {{}}  # {name}\n", f"{name}: [1.00]", verdict
    )
    played = Evaluation(lane=name, fitness=fitness, episode_length=9.0, episodes=64, error=error)
    return replace(scored, sample=replace(scored.sample, generation=generation), played=played)


OLDER, BEST = ranked(0, "angle", 302.46, 20.4), ranked(1, "height", 428.04, 33.1)
DONE = TrainingResult(lane="", state=TrainingState.FINISHED, fitness=1.0, curves={}, env_steps=1, seconds=1.0)
TRAINED = replace(ranked(1, "height_and_angle", 405.2, 22.4), result=DONE)
INFORMED = PromptPlan(count=4, informed=True, turns=(OLDER, BEST), best=BEST)
BALANCED = replace(
    CONTEXT,
    score_unit="steps the pole stays up",
    score_range=(0.0, 499.0),
    facts=(
        "An episode has at most 499 steps of 0.0166 s, 8.28 s in all. An episode ends early when the pole falls.",
        "At the start of an episode, in 64 of them:",
        "  `pole_angle` -0.1 to 0.1",
    ),
)


@pytest.mark.parametrize("style", ["free", "grammar"])
def test_the_prompt_that_says_what_counts_is_the_golden_one(style):
    plan = replace(INFORMED, siblings=(TRAINED,))
    golden(GOLDEN / f"prompt_{style}_informed.md", text(prompts.render(BALANCED, plan, style)))


@pytest.mark.parametrize("style", ["free", "grammar"])
def test_the_prompt_that_asks_for_progress_is_the_golden_one(style):
    golden(
        GOLDEN / f"prompt_{style}_progress.md", text(prompts.render(CONTEXT, PromptPlan(count=4), style, progress=True))
    )


def test_each_shown_reward_has_its_score_and_one_is_marked():
    told = [m.content for m in prompts.render(BALANCED, INFORMED, "free").messages if m.role == "user"]
    assert "The task score: steps the pole stays up, from 0 to 499; higher is better." in told[0]
    (line,) = (line for line in told[1].splitlines() if "generation 0" in line)
    assert line.endswith(
        "played in 64 episodes after training, scores 302 ± 20 (higher is better): not the best so far."
    )
    assert (
        "generation 1. Its policy, played in 64 episodes after training, scores 428 ± 33 (higher is better; "
        "± is the standard error over these episodes, of one training): " in told[2]
    )
    assert "the best of all so far. This is the one to improve." in told[2]
    (_, small) = (m.content for m in prompts.render(BALANCED, INFORMED, "grammar").messages if m.role == "user")
    assert "Its policy, played after training, scores 428 ± 33, the best of all so far.\n" in small
    assert "generation" not in small


@pytest.mark.parametrize("style", ["free", "grammar"])
def test_how_long_the_played_episodes_were_is_told_and_how_many_ended_early(style):
    """The curve of a training covers only the episodes that happened to end in an epoch."""
    fallen = Evaluation(lane="b", fitness=-0.17, episode_length=1643.7, episodes=256, costs={"falls": 0.625})
    plan = replace(INFORMED, turns=(OLDER, replace(BEST, played=fallen)))
    told = [m.content for m in prompts.render(BALANCED, plan, style).messages if m.role == "user"]
    assert "\nIts episodes lasted 1644 steps on average; 62% ended early.\n" in told[-1]
    if style == "free":
        assert "\nIts episodes lasted 9 steps on average.\n" in told[1]
    never = replace(BEST, played=replace(fallen, episodes=0))
    assert "Its episodes" not in prompts.render(BALANCED, replace(plan, turns=(never,)), style).messages[-1].content


def test_a_score_equal_to_the_best_is_no_loss():
    first, last = ranked(0, "first", 428.0), ranked(1, "last", 428.0)
    plan = PromptPlan(count=1, informed=True, turns=(first, last), best=last)

    def told(plan: PromptPlan) -> str:
        return prompts.render(BALANCED, plan, "free").messages[3].content

    assert "(higher is better): as good as the best so far.\n" in told(plan)
    assert "not the best so far by the votes" in told(replace(plan, opinion=Opinion(by_votes=True)))
    broken = replace(first, played=replace(first.played, costs={"speed": 2.0}))
    assert "not the best so far.\n" in told(replace(plan, turns=(broken, last), limits={"speed": 1.0}))


def test_that_no_score_is_higher_is_told_at_the_end_of_the_range_alone():
    most = "This is the one to improve. No score is higher: what is left is to learn it sooner, and with any seed.\n"

    def told(best: Scored, **changes: object) -> str:
        plan = replace(INFORMED, turns=(OLDER, best), best=best, **changes)
        return prompts.render(BALANCED, plan, "free").messages[-1].content

    solved = ranked(1, "solved", 499.0)
    assert most in told(solved)
    assert "No score is higher" not in told(ranked(1, "nearly", 498.9))
    assert "No score is higher" not in told(solved, opinion=Opinion(by_votes=True))
    unbounded = replace(BALANCED, score_range=(0.0, None))
    plan = replace(INFORMED, turns=(solved,), best=solved)
    assert "No score is higher" not in prompts.render(unbounded, plan, "free").messages[-1].content


def test_what_an_early_end_does_to_a_reward_is_advice_where_the_prompt_says_what_counts():
    for plan, advised in ((INFORMED, True), (replace(INFORMED, informed=False), False)):
        system = prompts.render(BALANCED, plan, "free").messages[0].content
        assert ("\n- An episode that has ended pays nothing more. " in system) == advised


def test_the_other_rewards_of_the_generation_are_told_by_score_and_terms():
    low, high = (
        replace(entry, result=DONE) for entry in (ranked(1, "low\x1b\nterm", 12.0, 1.0), ranked(1, "far", 99.0))
    )
    never = ranked(1, "never", None)
    plan = replace(INFORMED, siblings=(low, never, high))
    told = prompts.render(BALANCED, plan, "free").messages[-1].content
    assert "The other rewards of its generation, by score and terms:\n- 99: far\n- 12.0 ± 1.0: low term\n\n" in told
    assert "never" not in told
    assert "other rewards" not in prompts.render(BALANCED, plan, "grammar").messages[-1].content
    many = replace(INFORMED, siblings=(low,) * 40)
    assert prompts.render(BALANCED, many, "free").messages[-1].content.count("± 1.0") == prompts.MAX_SIBLINGS


def test_of_another_reward_whose_training_was_cut_it_is_told_when():
    cut = replace(DONE, state=TrainingState.CUT, message="after 0.125 of its steps, at place 3 of 4")
    plan = replace(INFORMED, siblings=(replace(ranked(1, "worth", 7.0), result=cut),))
    told = prompts.render(BALANCED, plan, "free").messages[-1].content
    assert "\n- 7, cut after 0.125 of its steps, at place 3 of 4: worth\n" in told


def test_of_another_reward_that_breaks_a_limit_it_is_told_which():
    costly = replace(ranked(1, "spin", 600.0, 1.0), result=DONE)
    assert costly.played is not None
    costly = replace(costly, played=replace(costly.played, costs={"torque": 80.0}))
    plan = replace(INFORMED, siblings=(costly,), limits={"torque": 40.0})
    told = prompts.render(BALANCED, plan, "free").messages[-1].content
    assert "\n- 600.0 ± 1.0, breaks a limit (torque 80 N m, above 40): spin\n" in told


def test_where_every_policy_breaks_a_limit_none_is_called_better():
    plan = replace(INFORMED, best=None, limits={"torque": 40.0})
    told = prompts.render(BALANCED, plan, "free").messages[-1].content
    assert "of one training): no policy keeps the limits so far. This is the one to improve." in told
    assert "best so far" not in told


def test_the_choice_of_a_person_is_marked_as_such():
    plan = replace(INFORMED, best=OLDER, opinion=Opinion(chosen=True))
    told = [m.content for m in prompts.render(BALANCED, plan, "free").messages if m.role == "user"]
    assert "302 ± 20 (higher is better): the best of all so far." in told[1]
    assert "not the best so far, but the choice of a person. This is the one to improve." in told[2]
    plan = replace(INFORMED, opinion=Opinion(by_votes=True))
    assert (
        "the best of all so far by the votes of a person" in prompts.render(BALANCED, plan, "free").messages[-1].content
    )


def test_advice_is_given_once_and_keeps_what_pays_for_brief_events():
    users = [m.content for m in prompts.render(BALANCED, INFORMED, "free").messages if m.role == "user"]
    assert [content.count("Read these numbers") for content in users] == [0, 0, 1]
    assert (
        "rare, brief events, such as reaching a goal, has a small and level mean even where it works: keep it"
        in users[2]
    )
    assert "is level over the last part of training" in users[2]


@pytest.mark.parametrize("style", ["free", "grammar"])
def test_the_published_search_is_told_no_score_unit_and_no_rank(style):
    plan = PromptPlan(count=4, turns=(OLDER, BEST))
    told = "".join(m.content for m in prompts.render(BALANCED, plan, style).messages)
    for word in ("499", "428", "An episode has", "higher is better", "best of all", "stays up"):
        assert word not in told.replace(CONTEXT.description, "")


@pytest.mark.parametrize(
    ("fitness", "error", "text"),
    [
        (428.04, 33.1, "428 ± 33"),
        (-0.26341, 0.0121, "-0.263 ± 0.012"),
        (1234.5, 0.0, "1234 ± 0"),
        (428.123, 9.96, "428 ± 10"),
        (428.123, 0.0996, "428.12 ± 0.10"),
        (3.2e7, 1.2e5, "3.2e+07 ± 120000"),
        (5.4321, 0.31, "5.43 ± 0.31"),
        (12345.6, 250.0, "12346 ± 250"),
        (0.5, None, "0.5"),
        (None, None, "undefined"),
    ],
)
def test_a_score_has_as_many_digits_as_its_error_allows(fitness, error, text):
    score = Evaluation(lane="", fitness=fitness, episode_length=1.0, episodes=1, error=error)
    assert prompts.with_error(score) == text


@pytest.mark.parametrize("style", ["free", "grammar"])
def test_when_nothing_trained_the_model_is_told_each_reason_once(style):
    plan = PromptPlan(count=1, failures=(FIRST, FIRST, SECOND))
    last = prompts.render(CONTEXT, plan, style).messages[-1]
    assert last.role == "user" and last.content.count("line 3: no `foo` [unknown-input]") == 1
    assert "None of the programs" in last.content


@pytest.mark.parametrize("style", ["free", "grammar"])
def test_a_generation_whose_trainings_all_ended_early_is_explained(style):
    diverged = replace(DONE, state=TrainingState.DIVERGED, message="reward is not finite")
    failed = replace(DONE, state=TrainingState.FAILED, message="out of memory")
    plan = PromptPlan(count=1, failures=tuple(replace(BEST, result=result) for result in (diverged, diverged, failed)))
    told = prompts.render(CONTEXT, plan, style).messages[-1].content
    assert told.count("- The training was stopped early (reward is not finite).") == 1
    assert "- No policy could be trained with this reward function.\n" in told and "memory" not in told


def test_a_repair_shows_the_reply_and_its_findings():
    prompt = Prompt(messages=(Message("user", "write"),), grammar="g", prefill="p")
    repair = prompts.repair(prompt, "my\x00 reply", REFUSED)
    assert [message.role for message in repair.messages] == ["user", "assistant", "user"]
    assert repair.messages[1].content == "my reply"
    assert "- line 3: no `foo` [unknown-input]" in repair.messages[2].content
    assert (repair.grammar, repair.prefill) == ("g", "p")


@pytest.mark.parametrize("opened", ["<think>", ""])
def test_a_repair_shows_a_long_program_whole_and_no_thoughts(opened):
    program = "def compute_reward(x):\n" + "    x = x + 0.001\n" * 500 + "    return x, {}"
    thoughts = f"{opened}Perhaps so:\ndef compute_reward(y):\n    return y\n" + "Or not.\n" * 1000 + "</think>"
    reply = f"{thoughts}\n\nHere it is.\n\n```python\n{program}\n```\nIt is smooth.\n"
    repair = prompts.repair(Prompt(messages=()), reply, REFUSED)
    assert repair.messages[0].content == f"```python\n{program}\n```"


@pytest.mark.parametrize(
    ("reply", "shown"),
    [
        ("<think>Hm.</think>\n\nNo.", "No."),
        ("Hm.\n</think>\n\nNo.", "No."),
        ("<think>Hm.</think>", "<think>Hm.</think>"),  # better than an empty turn
    ],
)
def test_a_repair_of_a_reply_without_a_program_shows_what_follows_its_thoughts(reply, shown):
    assert prompts.repair(Prompt(messages=()), reply, REFUSED).messages[0].content == shown


def test_control_invisible_and_direction_changing_characters_vanish():
    hostile = "a\x1b[31mb\u202ec\u200bd\x00e\ud800f\r\ng\th"
    assert prompts.clean(hostile, 100) == "abcdef\ng\th"


def test_a_long_text_loses_its_middle():
    cut = prompts.clean("a" * 600 + "b" * 600, 100)
    assert cut == "a" * 50 + "\n[...]\n" + "b" * 50


def test_braces_of_a_program_are_not_taken_for_fields_of_a_template():
    braces = entry("def compute_reward(x):\n    return x, {'{x}': x}\n", "{feedback} {0}")
    for style in ("free", "grammar"):
        prompt = prompts.render(CONTEXT, PromptPlan(count=1, turns=(braces,)), style)
        assert "{'{x}': x}" in prompt.messages[2].content and "{feedback} {0}" in prompt.messages[3].content


@pytest.mark.parametrize(("style", "limit"), [("free", 4_000), ("grammar", 2_000)])
def test_early_words_of_a_person_give_way_in_whole_lines(style, limit):
    early = tuple(f"{number:03d} {'x' * 93}" for number in range(60))  # 97 characters each: 100 with "> " and line end
    plan = PromptPlan(count=1, opinion=Opinion(words=(*early, "newest")))
    told = prompts.render(CONTEXT, plan, style).messages[-1].content
    said = told.split("the newest last:\n")[1].splitlines()
    kept = limit // 100 - 1  # the newest takes 9 characters, so one line fewer has room
    assert said[: kept + 2] == ["[...]", *(f"> {words}" for words in early[-kept:]), "> newest"]


def test_one_long_remark_keeps_its_beginning_and_its_end():
    plan = PromptPlan(count=1, opinion=Opinion(words=("first " + "x" * 5_000 + " last",)))
    told = prompts.render(CONTEXT, plan, "free").messages[-1].content
    assert "> first xxx" in told and "xxx last\n" in told and "\n> [...]\n" in told


def test_fences_in_a_program_end_no_code_block():
    program = 'def compute_reward(x):\n    """Pays as\n    ```\n    x\n    ```\n    does."""\n    return x, {}'
    opinion = Opinion(vetoed=(entry(program, "no"),))
    for style in ("free", "grammar"):
        prompt = prompts.render(CONTEXT, PromptPlan(count=1, turns=(entry(program, ""),), opinion=opinion), style)
        assert prompt.messages[2].content == f"````python\n{program}\n````"
    free = prompts.render(CONTEXT, PromptPlan(count=1, opinion=opinion), "free")
    assert f"````python\n{program}\n````" in free.messages[-1].content


def test_feedback_and_programs_are_capped():
    huge = entry("def f():\n" + "    pass\n" * 100_000, "y" * 100_000)
    free = prompts.render(CONTEXT, PromptPlan(count=1, turns=(huge,)), "free")
    assert (
        sum(len(message.content) for message in free.messages[2:]) < prompts.MAX_PROGRAM + prompts.MAX_FEEDBACK + 1500
    )
