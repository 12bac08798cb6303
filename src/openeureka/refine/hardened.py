"""What `eureka robust` found: how far worlds may change before policies fail, and which policy works in hard worlds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from ..method.hacking import learnt
from ..score import breach, pooled, worth
from ..stats import mean
from ..store import Store
from ..types import NOMINAL, PEAKS, Dynamics, Evaluation, Limits, Peak, Ranges, TrainingResult

_FACTOR = (0.4, 0.6, 0.8, 0.9, 1.1, 1.2, 1.5, 2.0)
GRID: Mapping[str, tuple[float, ...]] = {
    **dict.fromkeys(("mass", "inertia", "friction", "strength", "stiffness", "drive_damping"), _FACTOR),
    **dict.fromkeys(("joint_damping", "armature", "gravity"), _FACTOR),
    "delay": (0.02, 0.06, 0.1, 0.2),
    "noise": (0.02, 0.1, 0.2, 0.5),
    "push": (0.25, 0.5, 1.0, 2.0),
}
"""Values that a policy is tried at, one quantity at a time; the task's own value is tried once for all quantities."""
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
"""Worlds that no model is shown; F over them measures robustness here. Policies are chosen and judged in them, on
different start states."""
KEEPS = 0.75
"""Share of the learnt F that a policy must keep to count as working."""
# Names of tryouts follow. Scores are looked up by these names, and nothing takes a name apart.
SWEEP = "sweep"
"""A policy in the task's own world, as part of the sweep: see `swept`."""
UNTRAINED = "sweep untrained"
"""The policy that all begin from, with its untrained weights."""
OWN = "nominal"
"""The task's own world, in addition to those of `HARD`."""


def swept(quantity: str, value: float) -> str:
    """Name of the tryout of a policy in a world with one quantity changed."""
    return f"{SWEEP} {quantity}={value:g}"


def in_world(world: str, choosing: Peak | None) -> str:
    """Name of a tryout in one of `HARD` or in the task's own world: to judge, or to choose a lane's policy by peak."""
    return f"hard {world}" if choosing is None else f"choose {choosing} hard {world}"


PLAIN, LONGER, UNIFORM = "plain", "longer", "uniform"
"""Arms to compare with: the policy that the search left; the same, trained further as before; and one that trains with
the ranges `wide`, which are the same for every robot."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Carried:
    """How far one quantity may change before a policy fails."""

    name: str
    points: tuple[tuple[float, float | None, float | None], ...]
    """For each value, the task's own among them: the value, F, and the share of the learnt F that is left."""

    @property
    def _works(self) -> list[float]:
        """The values around the task's own at which it works throughout; none if learnt F is unknown."""
        if all(share is None for _, _, share in self.points):
            return []
        own = float(getattr(NOMINAL, self.name))
        kept = [own]
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
        """Lower end of the values around the task's own at which it works throughout; None if learnt F is unknown."""
        return min(self._works, default=None)

    @property
    def high(self) -> float | None:
        return max(self._works, default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class RobustArm:
    """One arm of the comparison: a policy."""

    name: str
    """`plain`, `longer`, `uniform`, or the name of a proposal."""
    ranges: Ranges | None
    nominal: Evaluation | None
    """Held-out score in the task's own world."""
    hard: float | None
    """Held-out F, mean over the hard worlds; None before these are played."""
    worlds: Mapping[str, Evaluation]
    """Held-out scores by hard world."""
    chosen_by: float | None
    """The same mean on start states for choosing; None for the plain policy, which was not chosen that way."""
    breach: str = ""
    """The run's limits that it breaks in the task's own world or on average over hard ones: held out if it was judged,
    otherwise on start states for choosing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Robust:
    """What `eureka robust` found, as far as it has come."""

    arms: tuple[RobustArm, ...]
    ours: str
    """Name of the chosen proposal; empty before one is chosen."""
    before: tuple[Carried, ...]
    after: tuple[Carried, ...]


def read(store: Store, results: Mapping[str, TrainingResult]) -> Robust | None:
    """What the store of a run says of `eureka robust`; None where that was not begun."""
    scores, own = store.lanes.tryouts(), store.lanes.ranges()
    records = {lane.ranges: lane.id for lane in store.lanes.all().values() if lane.role == "robust"}
    known = store.hardening()
    began = known.policy.lane if known is not None else ""
    if SWEEP not in scores.get(began, {}):
        return None
    tried, limits = {name: scores.get(records.get(name, ""), {}) for name in own}, store.config.cost_limits
    arms = [_arm(PLAIN, None, scores[began], limits), *(_arm(name, own[name], tried[name], limits) for name in own)]
    finished = [name for name in own if SWEEP in tried[name]]
    ours = max(finished, key=lambda name: worth(chosen(tried[name], limits), limits), default="")
    quantities = [name for name, grid in GRID.items() if any(swept(name, value) in scores[began] for value in grid)]
    after = carries(store, records[ours], quantities) if ours else ()
    before = carries(store, began, quantities)
    return Robust(arms=tuple(arms), ours=ours, before=tuple(before), after=tuple(after))


def chosen(scores: Mapping[str, Evaluation], limits: Limits) -> Evaluation | None:
    """Score of the lane's policy that does best in hard worlds, on start states for choosing; policies that keep the
    limits come first. None where F is undefined for all."""
    found = [_over(_by_world(scores, peak)) for peak in PEAKS]
    return max((one for one in found if one is not None), key=lambda one: worth(one, limits), default=None)


def _by_world(scores: Mapping[str, Evaluation], choosing: Peak | None = None) -> dict[str, Evaluation]:
    """Scores of one policy (see `in_world`) by world, the task's own first, as far as it was tried."""
    names = {world: in_world(world, choosing) for world in (OWN, *HARD)}
    return {world: scores[name] for world, name in names.items() if name in scores}


def _over(worlds: Mapping[str, Evaluation]) -> Evaluation | None:
    """A policy's score over its hard worlds. Each cost is the mean over them, or that in the task's own world if it is
    higher. None before the policy played there, or if F is undefined in one of them."""
    hard = [score for world, score in worlds.items() if world != OWN]
    if not hard or any(score.fitness is None for score in hard):
        return None
    found = pooled(hard, shared=True)
    own = worlds[OWN].costs if OWN in worlds else found.costs
    return replace(found, costs={name: max(cost, own.get(name, cost)) for name, cost in found.costs.items()})


def _arm(name: str, ranges: Ranges | None, scores: Mapping[str, Evaluation], limits: Limits) -> RobustArm:
    choice, worlds = chosen(scores, limits), _by_world(scores)
    over = _over(worlds)
    nominal = worlds.pop(OWN, None)
    return RobustArm(
        name=name,
        ranges=ranges,
        nominal=nominal,
        hard=mean([score.fitness for score in worlds.values()]) if over is not None else None,
        worlds=worlds,
        chosen_by=choice.fitness if choice is not None else None,
        breach=breach(over or choice, limits),
    )


def carries(store: Store, lane: str, quantities: Iterable[str]) -> list[Carried]:
    """How far each quantity may change before a lane's policy fails, as far as it was tried."""
    tryouts, known = store.lanes.tryouts(), store.hardening()
    scores, began = tryouts.get(lane, {}), tryouts.get(known.policy.lane, {}) if known is not None else {}
    nominal = scores.get(SWEEP)
    gained = learnt(nominal, began.get(UNTRAINED))

    def point(value: float, score: Evaluation | None) -> tuple[float, float | None, float | None]:
        fitness = score.fitness if score is not None else None
        if fitness is None or nominal is None or nominal.fitness is None or gained is None:
            return value, fitness, None
        return value, fitness, 1.0 - (nominal.fitness - fitness) / gained

    found: list[Carried] = []
    for name in quantities:
        points = [point(value, scores.get(swept(name, value))) for value in GRID[name]]
        points.append(point(float(getattr(NOMINAL, name)), scores.get(SWEEP)))
        found.append(Carried(name=name, points=tuple(sorted(points))))
    return found
