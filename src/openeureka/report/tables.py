"""The numbers of a run as tables, for every format alike."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import NamedTuple

from ..config import RunConfig
from ..method import baselines
from ..method.hacking import PEAK_NAMES, UNTRAINED, WORLDS, Kind
from ..numbers import dollars, duration, number, scored, spread
from ..refine.polishing import Polished
from ..refine.tuned import ORIGINAL, Tuned
from ..score import Outcome, SeedScores, human_normalised, plainly_normalised
from ..stats import mean
from ..types import Evaluation, Remark, RemarkKind
from .candidates import CandidateView
from .view import RunView

MOST_REWARDS = 4
"""Most given rewards in the head of a run; the table below holds all."""
SCALE = (
    "0 is as good as the sparse reward, 1 as the human one. There is none where the sparse reward is no worse than the "
    "human one, or where it is not decided whether the generated or the human reward is better."
)
"""How to read a human-normalised score, and where `on_scale` has none."""
NOISY = "actions keep the noise of training, because all episodes start alike"


@dataclass(frozen=True, slots=True)
class Table:
    """Text by rows. Cells may quote what a model wrote: a renderer makes them inert."""

    titles: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    """A sentence that says how to read it."""

    @property
    def filled(self) -> Table:
        """The same without columns that say nothing in any row."""
        kept = [column for column in range(len(self.titles)) if any(row[column] for row in self.rows)]
        rows = [[row[column] for column in kept] for row in self.rows]
        return Table([self.titles[column] for column in kept], rows, self.note)


class Tile(NamedTuple):
    """One number of the head of a run."""

    name: str
    value: str
    more: str = ""


def tiles(run: RunView) -> list[Tile]:
    """The run in a few numbers."""
    others = run.results.keys() - set(run.history.lanes)
    steps = sum(added for _, added in run.history.spent()) + sum(run.results[lane].env_steps for lane in others)
    trainings = Tile("trainings", str(len(run.results)), f"{steps:,} environment steps")
    if run.tunes:
        return [*(_tuned_tiles(run.tuned) if run.tuned is not None else ()), trainings]
    if not run.searched:
        return [*_score_tiles(run.given)[:MOST_REWARDS], trainings]
    slots, best = run.candidates, run.best
    human = run.baseline_score("human") if "human" in run.baselines else None
    played = human is not None and run.baselines["human"].lane in run.played
    different = len({c.program.id for c in slots if c.program is not None})
    drawn = [
        Tile("generations", f"{len(run.history.generations)} of {run.config.generations}"),
        Tile("candidates", str(len(slots)), f"{different} different, {sum(c.score is not None for c in slots)} scored"),
    ]
    found = [
        Tile("best F", number(best.score if best else None), f"{best.place}, {_how(best.played)}" if best else ""),
        Tile("human reward", number(human), f"F {_how(played)}" if human is not None else ""),
    ]
    found = [*drawn, *found] if run.outcome is None else [*_final_tiles(run.outcome), *drawn]
    tokens = run.usage.prompt_tokens + run.usage.completion_tokens
    cost = [Tile("cost", f"US$ {dollars(run.usage.cost_usd)}", f"{tokens:,} tokens")] if tokens else []
    return [*found, trainings, *cost]


def _final_tiles(outcome: Outcome) -> list[Tile]:
    """The scores that the verdict rests on. The search's own best score flatters."""
    found = _score_tiles({"generated reward": outcome.method, "human reward": outcome.human})
    if (score := on_scale(outcome)) is not None:
        found.append(Tile("score, held out", number(score, 3), "0: sparse, 1: human reward"))
    return found


def _tuned_tiles(found: Tuned) -> list[Tile]:
    """The final trainings with the numbers before and after."""
    named = {"before": ORIGINAL, "after": found.after}
    return _score_tiles({name: found.finals[key] for name, key in named.items() if key in found.finals})


def _score_tiles(rewards: Mapping[str, SeedScores]) -> list[Tile]:
    return [
        Tile(name, spread(own.scores), f"F held out, {len(own.scores)} seed{'s' if len(own.scores) > 1 else ''}")
        for name, own in rewards.items()
        if own.scores
    ]


def _how(played: object) -> str:
    return "when played" if played else "in training"


def search(run: RunView) -> Table:
    """The best of the search against the rewards that came with the task."""
    highest, crowned = run.ranking.best, run.best
    trained = {f"highest, {highest.sample.place}": highest.result} if highest is not None else {}
    if highest is not None and crowned is not None and crowned.place != highest.sample.place:
        trained[f"winner, {crowned.place}"] = crowned.result
    trained |= {f"{name} reward": result for name, result in run.baselines.items()}
    note = "One training each. The best of many tries looks better than it is: compare rewards by the final scores."
    if run.ranks == "training":
        rows = [(name, number(result.fitness if result else None)) for name, result in trained.items()]
        return Table(("during the search", "F, maximum over training"), rows, note)
    rows = [
        (name, scored(run.played.get(result.lane)) if result else "-", number(result.fitness if result else None))
        for name, result in trained.items()
    ]
    note += " ± here, and of single candidates: standard error over episodes."
    return Table(("during the search", "F when played", "F in training"), rows, note)


def final(run: RunView, outcome: Outcome) -> Table:
    """The best reward of a run against the others with fresh seeds."""
    rewards = {"best generated": outcome.method}
    rewards |= {f"runner-up {place}": own for place, own in outcome.rivals.items()}
    rewards |= {"human": outcome.human, "sparse": outcome.sparse}
    rows = [(name, spread(own.held_out), spread(own.training), str(len(own.training))) for name, own in rewards.items()]
    how = NOISY if run.noisy else "deterministic actions"
    note = f"Mean ± standard deviation over seeds. Held out: {how}, fresh episodes."
    if run.known_baselines is not None:
        note += f" {run.known_baselines.sentence()}{' Those played without noise.' if run.noisy else ''}"
    return Table(("reward", "F, held out", "F, training maximum", "seeds"), rows, note)


def given(run: RunView) -> Table:
    """A row for each given reward."""
    scale, note = _scale(run)
    rows = []
    for name, reward in run.given.items():
        own = [lane for lane in run.lanes.values() if lane.reward == name and lane.role == "given"]
        lanes = [lane.id for lane in own if lane.id in run.results]
        results = [run.results[lane] for lane in lanes]
        lengths = [run.evaluations[lane].episode_length for lane in lanes if lane in run.evaluations]
        rows.append(
            (
                name,
                spread(reward.training),
                spread(reward.held_out),
                spread(lengths),
                spread([result.correlation for result in results]),
                f"{sum(result.env_steps for result in results):,}",
                duration(max(result.seconds for result in results)),
                number(human_normalised(mean(reward.scores), *scale)),
            )
        )
    titles = ("reward", "F in training", "F held out", "episode length", "correlation", "steps", "time", "score")
    return Table(titles, rows, f"{note} Held out: {NOISY}." if run.noisy else note)


def polished(run: RunView, found: Polished) -> Table:
    """A row for the policy that training began from, and one for each lane that trained it further."""
    began, held_out = run.lanes.get(found.began.lane), scored(found.before)
    own = _reward(run, began.reward) if began is not None else "-"
    rows = [
        ("the best reward's, from which all started", own, "-", scored(run.played.get(found.began.lane)), held_out),
        *(
            (
                one.lane.id,
                _reward(run, one.lane.reward),
                f"{one.start.fresh:.0%}",
                scored(one.played),
                scored(found.after) if one == found.chosen else "-",
            )
            for one in found.tries
        ),
    ]
    steps = max((one.result.env_steps for one in found.tries if one.result is not None), default=0)
    note = (
        f"Each lane trained for {steps:,} steps, from that policy's weights mixed with a share of fresh weights. The "
        "lane that plays best is compared with that policy in new episodes. ± is the standard error over episodes of "
        "a single policy: it says nothing about how good a reward is."
    )
    note += f" Held out: {NOISY}." if run.noisy else ""
    return Table(("policy", "reward", "fresh weights", "F when played", "F held out"), rows, note)


def _reward(run: RunView, identity: str) -> str:
    """What people call a reward: its first place in the search, or its name as a weighting."""
    names = (name for name, candidate in run.texts.items() if candidate.id == identity)
    return str(run.places.get(identity, "")) or next(names, identity)


def _scale(run: RunView) -> tuple[tuple[float | None, float | None], str]:
    """Held-out F of the human and the sparse reward, trained in the run or known beforehand, and a note on both."""
    text, origin = "Score: human-normalised, (F - sparse) / |human - sparse|, held out.", ""
    rewards, known = run.given, baselines.measured(run.config)
    if "human" in rewards and "sparse" in rewards:
        human, sparse = mean(rewards["human"].scores), mean(rewards["sparse"].scores)
    elif known is None:
        return (None, None), f"{text} It needs both: add human and sparse to reward=."
    else:
        human, sparse = mean(known.human.held_out), mean(known.sparse.held_out)
        origin = f" {known.sentence()}"
    if human is not None and human == sparse:
        text = f"No score: the human and the sparse reward both reach F {number(human)} held out, so there is no scale."
    return (human, sparse), text + origin


def measures(outcome: Outcome) -> Table:
    """Scores on a scale that tasks share."""
    rows = [
        ("human-normalised score, (F - sparse) / (human - sparse), held out", number(on_scale(outcome), 3)),
        ("the same on maxima over training, as published", number(on_scale(outcome, training=True), 3)),
        ("correlation with the human reward over transitions", number(outcome.correlation, 2)),
        ("the same over epochs, as the published code computes it", number(outcome.curve_correlation, 2)),
    ]
    return Table(("score", "value"), rows, f"Human-normalised: {SCALE}")


def on_scale(outcome: Outcome | None, *, training: bool = False) -> float | None:
    """The human-normalised score, held out or on maxima over training. None while it is not decided whether the
    generated or the human reward is better, and where the sparse reward is no worse than the human one."""
    if outcome is None or outcome.difference is None or not outcome.difference.sure:
        return None
    rewards = outcome.method, outcome.human, outcome.sparse
    return plainly_normalised(*(mean(own.training if training else own.held_out) for own in rewards))


def exploits(run: RunView) -> Table:
    """The signs of an exploited reward that were looked for, and what was found."""
    found = {sign.kind: sign.sentence for sign in run.signs}
    looked = worlds(run).rows and any(UNTRAINED in lane.tryouts for lane in run.tried)
    unseen = {Kind.FRAGILITY: "not seen" if looked else "not checked"}
    rows = [
        (kind, "SUSPECTED" if kind in found else unseen.get(kind, "not seen"), found.get(kind, ""))
        for kind in Kind
        if (kind is not Kind.LIMITS or run.config.cost_limits) and (kind is not Kind.PHYSICS or kind in found)
    ]
    before = ", before numbers were fitted" if run.fitted is not None else ""
    note = f"Signs of reward hacking in the final trainings{before}; a sign is not proof."
    return Table(("sign", "result", "numbers"), rows, note)


def worlds(run: RunView) -> Table:
    """Held-out F of the kept policy in slightly changed worlds; empty for a task that has no such worlds."""
    rows = [
        (name, scored(score))
        for lane in run.tried
        if any(score.episodes + score.lost for name, score in lane.tryouts.items() if name in WORLDS)
        for name, score in {"unchanged": lane.held_out, **lane.tryouts}.items()
        if (name in WORLDS or score is lane.held_out) and name not in PEAK_NAMES.values()
    ]
    fitted = run.fitted is not None
    whose = "the winner's policy, before its numbers were fitted" if fitted else "the policy in best/"
    note = f"One policy: {whose}. It was picked as the best of several seeds, so its F is above their mean. "
    note += "± here: standard error over episodes."
    return Table(("world", f"F of {whose}, held out"), rows, note)


def generations(run: RunView) -> Table:
    """A row per finished generation. Best and mean F are of the slots with a score whose policies keep the limits."""
    done, steps = run.history.generations, Counter[int]()
    for entry, added in run.history.spent():
        steps[entry.sample.generation] += added
    rows = [
        (
            str(g.index),
            str(len(g.entries)),
            ", ".join(f"{n} {code}" for code, n in Counter(e.sample.verdict.code for e in g.entries).items()),
            str(sum(entry.sample.attempts for entry in g.entries)),
            str(g.trained),
            f"{steps[g.index]:,}",
            number(g.best.score if g.best else None),
            number(mean(g.scores)),
        )
        for g in done
    ]
    titles = ("generation", "slots", "verdicts", "replies", "trained", "environment steps", "best F", "mean F")
    slots, trained = sum(len(g.entries) for g in done), sum(g.trained for g in done)
    return Table(titles, rows, f"Of all slots, {trained / slots:.0%} trained." if slots else "")


def facts(candidate: CandidateView) -> Table:
    """One candidate in numbers."""
    usage, result = candidate.usage, candidate.result
    rows = [
        ("program", candidate.program.id if candidate.program else "none"),
        ("F when played", _episodes(candidate.played)),
        ("F in training, maximum over epochs", number(candidate.fitness)),
        ("replies", str(len(candidate.attempts))),
    ]
    if usage.completion_tokens:
        rows.append(("tokens", f"{usage.prompt_tokens:,} read, {usage.completion_tokens:,} written"))
    if usage.cost_usd:
        rows.append(("cost", f"US$ {dollars(usage.cost_usd)}"))
    if candidate.strength is not None:
        rows.append(("strength by votes", number(candidate.strength, 3)))
    if candidate.vetoed:
        rows.append(("vetoed by a person", "yes"))
    if result is not None:
        rows += [
            ("correlation with the human reward", number(result.correlation, 2)),
            ("training", f"{result.env_steps:,} steps, {duration(result.seconds)}"),
            *([("why it ended", result.message)] if result.message else []),
        ]
    return Table(("", ""), rows)


def _episodes(score: Evaluation | None) -> str:
    if score is None:
        return "-"
    lost = f", {score.lost} more lost as the physics broke down" if score.lost else ""
    return f"{scored(score)}, {score.episodes} episodes{lost}"


def said(remarks: Sequence[Remark]) -> str:
    """A person's remarks, one after the other. Words are left as they are: a renderer makes them inert."""
    return "\n".join(_said(remark) for remark in remarks)


def _said(remark: Remark) -> str:
    match remark.kind:
        case RemarkKind.WORDS:
            return remark.text
        case RemarkKind.VOTE:
            return f"[{remark.place} is better than {remark.over}]"
        case RemarkKind.GO:
            return "[go]"
    return f"[{remark.kind}: {remark.place}]"


def settings(config: RunConfig) -> Table:
    """Every field of a config."""
    return Table(("setting", "value"), [(key, str(value)) for key, value in asdict(config).items()])
