"""Ranges with a reason, as in DrEureka (arXiv 2406.01967): how far the best policy carries, what a model proposes from
that, and which of its proposals makes a policy that works in hard worlds.

Everything is kept in the run that found the reward. To go on is to run it again.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from . import prompts
from .errors import ConfigError, ModelError
from .hacking import Trial
from .lanes import BASELINES, Lanes, Wanted
from .llm import price
from .llm.client import LanguageModel
from .sampling import request_seed
from .score import mean, rank
from .store import Store, artifacts
from .types import (
    NOMINAL,
    Candidate,
    Dynamics,
    Evaluation,
    Lane,
    Peak,
    PolicyId,
    Prompt,
    Ranges,
    RewardProgram,
    TrainingResult,
)
from .types.dynamics import SCALES

_FACTOR = (0.4, 0.6, 0.8, 0.9, 1.1, 1.2, 1.5, 2.0)
GRID: Mapping[str, tuple[float, ...]] = {
    **dict.fromkeys(("mass", "inertia", "friction", "strength", "stiffness", "drive_damping"), _FACTOR),
    **dict.fromkeys(("joint_damping", "armature", "gravity"), _FACTOR),
    "delay": (0.02, 0.06, 0.1, 0.2),
    "noise": (0.02, 0.1, 0.2, 0.5),
    "push": (0.25, 0.5, 1.0, 2.0),
}
"""Where a policy is tried, one quantity at a time; the task's own value is tried once for all."""
HARD: Mapping[str, Dynamics] = {
    "mass -30 %": Dynamics(mass=0.7),
    "mass +30 %": Dynamics(mass=1.3),
    "friction -30 %": Dynamics(friction=0.7),
    "friction +30 %": Dynamics(friction=1.3),
    "strength -30 %": Dynamics(strength=0.7),
    "strength +30 %": Dynamics(strength=1.3),
    "delay 40 ms": Dynamics(delay=0.04),
    "noise 0.05": Dynamics(noise=0.05),
    "heavy, weak, late": Dynamics(mass=1.3, strength=0.7, delay=0.04),
    "light, slippery, noisy": Dynamics(mass=0.7, friction=0.7, noise=0.05),
}
"""Worlds that no policy is trained for and no model is shown; F over them is what robust means here."""
KEEPS = 0.75
"""Share of what was learnt that a policy keeps where it is said to work."""
SWEEP_EPISODES, CHOOSING_EPISODES, HARD_EPISODES = 32, 16, 64
PEAKS: tuple[Peak, ...] = ("reward", "last", "fitness")
REPAIRS = 2
"""Times that a model may correct ranges that cannot be used, where the settings say no number."""
PLAIN, UNIFORM = "plain", "uniform"
"""The policy that the search left, and ranges that nobody gave a reason for."""
_BLOCK = re.compile(r"```(?:ya?ml)?[ \t]*\n(.*?)```", re.DOTALL)
LONGEST = 4000
"""Characters of a table that is read at all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Robot:
    """What ranges are proposed for."""

    task: str
    """What it is to do."""
    description: str
    """Its bodies, joints and drives, in lines."""
    quantities: tuple[str, ...]
    """Those of `types.Dynamics` that change anything of it."""
    uniform: Ranges
    """Ranges without a reason, to compare with."""
    read: Callable[[str], Ranges]
    """Ranges from YAML; raises ConfigError for anything else."""


# --- what is done -----------------------------------------------------------------------------------------------------


def robust(lanes: Lanes, model: LanguageModel, robot: Robot) -> None:
    """Do what is missing of the chain. `robust/` then holds the policy and the ranges that made it.

    Args:
        lanes: of the run that found the reward; its settings say how many proposals there are (`sample`).

    Raises:
        ConfigError: when the run has no policy yet.
        ModelError: when no reply holds ranges that can be used.
        EurekaError: what else stopped it; all that was finished is stored, and calling again continues.
    """
    config, store = lanes.config, lanes.store
    began = _best(store)
    if began is None:
        raise ConfigError(f"{store.directory} holds no policy yet; `eureka resume {store.directory}` goes on with it.")
    lanes.observer.phase(config.generations, "evaluate")
    lanes.try_out(sweep(began, robot.quantities), episodes=SWEEP_EPISODES)
    proposed = propose(lanes, model, robot, began)
    model.close()  # an embedded model must not run while training does: they fight for the same cores
    store.save_ranges({UNIFORM: robot.uniform, **proposed})
    reward = store.lanes.all()[began.lane].reward
    graph = program(store, reward)
    wanted: list[Wanted] = [(Lane(reward, config.seed, "robust", ranges=name), graph) for name in store.ranges()]
    lanes.observer.phase(config.generations, "train")
    lanes.train(wanted)
    lanes.observer.phase(config.generations, "play")
    arms = {lane.ranges: PolicyId(lane.id, _peak(lanes, lane, robot.quantities)) for lane, _ in wanted}
    lanes.observer.phase(config.generations, "evaluate")
    ours = max((name for name in arms if name != UNIFORM), key=lambda name: rank(_chosen_by(store, arms[name])))
    judged = (began, arms[UNIFORM], arms[ours])
    hard = hard_worlds(robot.quantities)
    lanes.try_out([trial for own in judged for trial in trials(own, hard)], episodes=HARD_EPISODES)
    lanes.try_out(sweep(arms[ours], robot.quantities), episodes=SWEEP_EPISODES)
    store.save_robust(written(store.ranges()[ours]), arms[ours])


def _best(store: Store) -> PolicyId | None:
    """The policy in `best/`; of equal ones that of the reward which lies there too."""
    source = artifacts.read(store.directory, "best/reward.py")
    own = Candidate.of(source.decode(errors="replace")).id if source is not None else None
    lanes, given, judged = store.lanes.all(), store.given(), store.lanes.evaluations()

    def fits(policy: PolicyId) -> tuple[bool, bool, bool]:
        lane = lanes[policy.lane]
        return lane.role != "robust", given.get(lane.reward, lane.reward) == own, policy.lane in judged

    return max(store.lanes.exposed("best"), key=fits, default=None)


def sweep(policy: PolicyId, quantities: Iterable[str]) -> list[Trial]:
    """A policy in the task's own world, and with each quantity changed alone."""
    worlds = {"sweep": NOMINAL}
    worlds |= {f"sweep {name}={value:g}": Dynamics(**{name: value}) for name in quantities for value in GRID[name]}
    return trials(policy, worlds)


def trials(policy: PolicyId, worlds: Mapping[str, Dynamics], of: str = "") -> list[Trial]:
    return [Trial(lane=policy.lane, name=of + name, peak=policy.peak, dynamics=world) for name, world in worlds.items()]


def hard_worlds(quantities: Sequence[str]) -> dict[str, Dynamics]:
    """Those of `HARD` that are other worlds for a robot, as far as it has their quantities; and its own."""
    found: dict[str, Dynamics] = {"hard nominal": NOMINAL}
    for name, world in HARD.items():
        known = {each: getattr(world, each) for each in quantities if getattr(world, each) != getattr(NOMINAL, each)}
        if known and Dynamics(**known) not in found.values():
            found[f"hard {name}"] = Dynamics(**known)
    return found


def propose(lanes: Lanes, model: LanguageModel, robot: Robot, began: PolicyId) -> dict[str, Ranges]:
    """Ranges by name, one a slot whose reply, or a repair of it, can be used."""
    config, store = lanes.config, lanes.store
    prompt = asked(robot, carries(store, began.lane, robot.quantities))
    found: dict[str, Ranges] = {}
    wrong: dict[int, Prompt] = {}
    reason = ""
    for attempt in range(1 + (config.repair or REPAIRS)):
        vacant = [slot for slot in range(config.sample) if f"r{slot}" not in found]
        if attempt:
            for slot in vacant:
                _draw(lanes, model, wrong[slot], attempt, [slot])
        else:
            _draw(lanes, model, prompt, attempt, vacant)
        replies = store.proposals()
        for slot in vacant:
            reply = replies[slot, attempt].text
            try:
                found[f"r{slot}"] = robot.read(table_of(reply))
            except ConfigError as error:
                reason = str(error)
                wrong[slot] = prompts.ranges_again(wrong.get(slot, prompt), reply, reason)
    if not found:
        raise ModelError(f"No reply holds ranges that can be used: {reason} Ask another model, or add repair=4.")
    return dict(sorted(found.items(), key=lambda item: int(item[0][1:])))


def _draw(lanes: Lanes, model: LanguageModel, prompt: Prompt, attempt: int, slots: Sequence[int]) -> None:
    config, store = lanes.config, lanes.store
    missing = [slot for slot in slots if (slot, attempt) not in store.proposals()]
    if not missing:
        return
    lanes.observer.phase(config.generations, "sample")
    if config.max_cost:
        paid = [*store.replies(), *store.proposals().values()]
        price.afford(config.max_cost, paid, price.find(config.model, config.price), prompt, len(missing))
    seed = request_seed(config.seed, config.generations, attempt, missing[0])
    for slot, reply in zip(missing, model.sample(prompt, n=len(missing), seed=seed), strict=True):
        store.save_proposal(slot, attempt, prompt, reply)


def table_of(reply: str) -> str:
    """The last code block of a reply, or all of it. Raises ConfigError for what is too long to be a table."""
    blocks = _BLOCK.findall(reply)
    text = blocks[-1] if blocks else reply
    if len(text) > LONGEST:
        raise ConfigError(f"The reply is no table of ranges: it has {len(text)} characters.")
    return text


def asked(robot: Robot, carried: Sequence[Carried]) -> Prompt:
    """The prompt: the robot, and where its policy still works."""
    lines = []
    for one in carried:
        scores = ", ".join(f"{value:g}: {_share(share, fitness)}" for value, fitness, share in one.points)
        works = f"; works from {one.low:g} to {one.high:g}" if one.low is not None and one.high is not None else ""
        lines.append(f"- {one.name}: {scores}{works}")
    return prompts.ranges(
        task=robot.task,
        robot=robot.description,
        note=f"in brackets, the share of what was learnt that is left; works: at least {KEEPS:.0%}",
        sweep=lines,
        quantities={name: (SCALES[name].unit, SCALES[name].least, SCALES[name].most) for name in robot.quantities},
        ends={name: _ends(name) for name in robot.quantities},
    )


def _ends(name: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Values that the grammar offers for the lowest and the highest end: those of the grid about the task's own."""
    own = float(getattr(NOMINAL, name))
    return (*(v for v in GRID[name] if v < own), own), (own, *(v for v in GRID[name] if v > own))


def _share(share: float | None, fitness: float | None) -> str:
    text = "undefined" if fitness is None else f"{fitness:.3g}"
    return text if share is None else f"{text} ({share:.0%})"


def program(store: Store, reward: str) -> RewardProgram:
    """What a lane of this reward trains under."""
    if reward in dict(BASELINES):
        return dict(BASELINES)[reward]
    verdict = store.verdict(store.given().get(reward) or reward)
    if verdict is None or verdict.graph is None:
        raise ConfigError(f"{store.directory} holds no program of the reward {reward}.")
    return verdict.graph


def _peak(lanes: Lanes, lane: Lane, quantities: Sequence[str]) -> Peak:
    """Which of a lane's policies does best in hard worlds, on start states for choosing."""
    hard = hard_worlds(quantities)
    own = [PolicyId(lane.id, peak) for peak in PEAKS]
    choosing = [trial for policy in own for trial in trials(policy, hard, f"choose {policy.peak} ")]
    lanes.try_out(choosing, choosing=True, episodes=CHOOSING_EPISODES)
    return max(own, key=lambda policy: rank(_chosen_by(lanes.store, policy))).peak


def _chosen_by(store: Store, policy: PolicyId) -> float | None:
    """Mean F over hard worlds on start states for choosing."""
    return _mean(store.lanes.trials().get(policy.lane, {}), f"choose {policy.peak} hard ")


def _mean(scores: Mapping[str, Evaluation], prefix: str) -> float | None:
    """Over the hard worlds; None where F is undefined in one of them."""
    own = [score.fitness for name, score in scores.items() if name.startswith(prefix) and not name.endswith(" nominal")]
    return mean(own) if None not in own else None


def written(ranges: Ranges) -> str:
    """As `randomise=FILE.yaml` reads them."""
    return "".join(f"{name}: [{low:g}, {high:g}]\n" for name, (low, high) in ranges.drawn.items())


# --- what was found ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Carried:
    """How far a policy carries along one quantity."""

    name: str
    points: tuple[tuple[float, float | None, float | None], ...]
    """Value, F, and the share of what was learnt that is left of it; the task's own value among them."""

    @property
    def _works(self) -> list[float]:
        own = float(getattr(NOMINAL, self.name))
        kept: list[float] = [own]
        above = [(value, share) for value, _, share in self.points if value > own]
        below = [(value, share) for value, _, share in reversed(self.points) if value < own]
        for side in (above, below):
            for value, share in side:
                if share is None or share < KEEPS:
                    break
                kept.append(value)
        return kept

    @property
    def low(self) -> float | None:
        """The end of where it works without a gap; None where nothing says what was learnt."""
        return min(self._works) if any(share is not None for _, _, share in self.points) else None

    @property
    def high(self) -> float | None:
        return max(self._works) if any(share is not None for _, _, share in self.points) else None


@dataclass(frozen=True, slots=True, kw_only=True)
class RobustArm:
    """One policy of the comparison."""

    name: str
    """`plain`, `uniform`, or the proposal."""
    ranges: Ranges | None
    nominal: Evaluation | None
    """In the task's own world, held out."""
    hard: float | None
    """Mean F over the hard worlds, held out; None before that."""
    worlds: Mapping[str, Evaluation]
    """By hard world."""
    chosen_by: float | None
    """The same mean on start states for choosing; the plain policy was not chosen so."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Robust:
    """What came of it."""

    arms: tuple[RobustArm, ...]
    ours: str
    """The proposal that was chosen; empty before that."""
    before: tuple[Carried, ...]
    after: tuple[Carried, ...]


def read(store: Store, results: Mapping[str, TrainingResult]) -> Robust | None:
    """What the store of a run says of it; None where it was not begun."""
    scores, own = store.lanes.trials(), store.ranges()
    records = {lane.ranges: lane.id for lane in store.lanes.all().values() if lane.role == "robust"}
    began = next((lane for lane, named in scores.items() if "sweep" in named and lane not in records.values()), None)
    if began is None:
        return None
    arms = [_arm(PLAIN, None, scores[began]), *(_arm(n, own[n], scores.get(records.get(n, ""), {})) for n in own)]
    swept = [arm for arm in arms if "sweep" in scores.get(records.get(arm.name, ""), {})]
    ours = max(swept, key=lambda arm: rank(arm.chosen_by)).name if swept else ""
    quantities = [name for name in GRID if any(key.startswith(f"sweep {name}=") for key in scores[began])]
    after = carries(store, records[ours], quantities) if ours else ()
    before = carries(store, began, quantities)
    return Robust(arms=tuple(arms), ours=ours, before=tuple(before), after=tuple(after))


def _arm(name: str, ranges: Ranges | None, scores: Mapping[str, Evaluation]) -> RobustArm:
    peaks = [_mean(scores, f"choose {peak} hard ") for peak in PEAKS]
    worlds = {key.removeprefix("hard "): score for key, score in scores.items() if key.startswith("hard ")}
    return RobustArm(
        name=name,
        ranges=ranges,
        nominal=worlds.pop("nominal", None),
        hard=_mean(scores, "hard "),
        worlds=worlds,
        chosen_by=max((peak for peak in peaks if peak is not None), default=None),
    )


def carries(store: Store, lane: str, quantities: Iterable[str]) -> list[Carried]:
    """How far a lane's policy carries along each quantity, as far as it was tried."""
    scores, result = store.lanes.trials().get(lane, {}), store.lanes.result(lane)
    nominal = scores["sweep"].fitness if "sweep" in scores else None
    untrained = next((v for v in (result.curves.get("fitness", ()) if result else ()) if v is not None), None)
    learnt = nominal - untrained if nominal is not None and untrained is not None else 0.0

    def point(value: float, score: Evaluation | None) -> tuple[float, float | None, float | None]:
        fitness = score.fitness if score is not None else None
        if fitness is None or nominal is None or learnt <= 0.0:
            return value, fitness, None
        return value, fitness, 1.0 - (nominal - fitness) / learnt

    found = []
    for name in quantities:
        points = [point(value, scores.get(f"sweep {name}={value:g}")) for value in GRID[name]]
        points.append(point(float(getattr(NOMINAL, name)), scores.get("sweep")))
        found.append(Carried(name=name, points=tuple(sorted(points))))
    return found
