"""Domain randomisation as in DrEureka (arXiv 2406.01967): measures how far worlds may change before the best policy
fails, lets a model propose ranges from that, and finds the proposal whose policy works in hard worlds.

Everything is kept in the run that found the reward. To go on is to run it again.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from ..config import BEST, SCRATCH
from ..errors import ConfigError, ModelError
from ..events import Began, Replied
from ..llm.client import LanguageModel
from ..method import prompts
from ..method.lanes import CHOOSING, ROBUST, Lanes, drawn
from ..method.sampling import draw, request_seed
from ..method.seeds import Wanted
from ..parsing import command_line
from ..score import worth
from ..store import Store, expect_files
from ..text import plain
from ..types import (
    NOMINAL,
    PEAKS,
    Dynamics,
    Hardening,
    Lane,
    Message,
    Peak,
    PolicyId,
    Prompt,
    Ranges,
    Start,
    Tryout,
)
from ..types.dynamics import SCALES
from .hardened import (
    GRID,
    HARD,
    KEEPS,
    LONGER,
    OWN,
    SWEEP,
    UNIFORM,
    UNTRAINED,
    Carried,
    carries,
    chosen,
    in_world,
    swept,
)

SWEEP_EPISODES, CHOOSING_EPISODES, HARD_EPISODES = 32, 16, 64
PARTS = 2
"""Parts of a training's steps; by default, a policy that goes on trains for one of them."""
_BLOCK = re.compile(r"```(?:ya?ml)?[ \t]*\n(.*?)```", re.DOTALL | re.IGNORECASE)
LONGEST = 4000
"""Most characters of a table; a longer one is not read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Robot:
    """The robot that ranges are proposed for."""

    task: str
    """What the robot is to do."""
    description: str
    """The robot's bodies, joints and drives, in lines."""
    quantities: tuple[str, ...]
    """Quantities of `types.Dynamics` that change anything of this robot."""
    uniform: Ranges
    """The ranges `wide`, which are the same for every robot, to compare with."""
    read: Callable[[str], Ranges]
    """Reads ranges from YAML; raises ConfigError for anything else."""


def harden(lanes: Lanes, model: LanguageModel, robot: Robot, training: Hardening) -> None:
    """Do the missing steps. `robust/` then holds the chosen policy and the ranges that it trained with.

    Args:
        lanes: lanes of the run that found the reward; its setting `sample` is the number of proposals.
        training: as `planned` returns it.

    Raises:
        ModelError: when no reply holds ranges that can be used.
        EurekaError: what else stopped it; all that was finished is stored, and calling again continues.
    """
    config, store, began = lanes.config, lanes.store, training.policy
    store.save_hardening(training)
    lanes.tell(Began("evaluate"))
    # A model must not see the scores that judge its ranges. Both sweeps use the same start states, to be compared.
    origin = store.lanes.all()[began.lane]
    untrained = Tryout(lane=began.lane, name=UNTRAINED, peak=began.peak, untrained=origin.seed)
    lanes.try_out([*sweep(began, robot.quantities), untrained], starts=CHOOSING, episodes=SWEEP_EPISODES)
    proposed = propose(lanes, model, robot, training)
    model.close()  # an embedded model must not run while training does: both would compete for the same cores
    # Trained further as before; from scratch, this arm would be the best policy again.
    as_it_was = {LONGER: drawn(config) or Ranges(NOMINAL, NOMINAL)} if not training.anew else {}
    store.lanes.save_ranges({**as_it_was, UNIFORM: robot.uniform, **proposed})
    reward, start = origin.reward, Start(began, 0.0) if not training.anew else None
    program = store.rewards.program(reward)
    if program is None:
        raise ConfigError(f"{store.directory} has no program of the reward {reward}.")
    names = store.lanes.ranges()
    wanted: list[Wanted] = [(Lane(reward, config.seed, "robust", start, ranges=name), program) for name in names]
    lanes.tell(Began("train"))
    lanes.train(wanted, steps=training.steps)
    lanes.tell(Began("play"))
    arms = {lane.ranges: PolicyId(lane.id, _peak(lanes, lane, robot.quantities)) for lane, _ in wanted}
    lanes.tell(Began("evaluate"))
    beside = [name for name in (LONGER, UNIFORM) if name in arms]
    ours = max((name for name in arms if name not in beside), key=lambda name: _worth(lanes, arms[name].lane))
    judged = (began, *(arms[name] for name in beside), arms[ours])
    # Not on the start states of final scores: the policy that all begin from may have been chosen by these.
    hard = [tryout for own in judged for tryout in hard_tryouts(own, robot.quantities)]
    lanes.try_out(hard, starts=ROBUST, episodes=HARD_EPISODES)
    lanes.try_out(sweep(arms[ours], robot.quantities), starts=CHOOSING, episodes=SWEEP_EPISODES)
    store.save_robust(written(store.lanes.ranges()[ours]), arms[ours])


def planned(store: Store, start: str, steps: int) -> Hardening:
    """How the robust policies of a run are to be trained: as earlier ones were, if there are any.

    Args:
        start, steps: as in `RobustConfig`.

    Raises:
        ConfigError: where earlier ones were trained in another way, or there is no policy to go on from.
    """
    before = store.hardening()
    policy = before.policy if before is not None else _best(store)
    usual = store.config.steps if start == SCRATCH else _half(store, policy)
    wanted = Hardening(policy=policy, anew=start == SCRATCH, steps=steps or usual)
    if before is None or before == wanted:
        return wanted
    kept = f"start={SCRATCH if before.anew else BEST} steps={before.steps}"
    raise ConfigError(f"The robust policies of {store.directory} train with {kept}; add both to continue them.")


def _half(store: Store, policy: PolicyId) -> int:
    """Half of the steps of the training that a policy first came from, before lanes went on from it."""
    lane, lanes = policy.lane, store.lanes.all()
    while (start := lanes[lane].start) is not None:
        lane = start.policy.lane
    return max(1, store.lanes.results()[lane].env_steps // PARTS)


def _best(store: Store) -> PolicyId:
    """The policy that `polish=` left, or the one in `best/`. Raises ConfigError before there is one."""
    found = store.lanes.best_policy() or store.best()
    if found is None:
        expect_files(store)
        command = command_line("resume", store.directory)
        raise ConfigError(f"{store.directory} has no policy yet; `{command}` continues the run.")
    return found


def sweep(policy: PolicyId, quantities: Iterable[str]) -> list[Tryout]:
    """Tryouts of a policy in the task's own world, and with each quantity changed alone."""
    worlds = {SWEEP: NOMINAL}
    worlds |= {swept(name, value): Dynamics(**{name: value}) for name in quantities for value in GRID[name]}
    return tryouts(policy, worlds)


def tryouts(policy: PolicyId, worlds: Mapping[str, Dynamics]) -> list[Tryout]:
    """Tryouts of one policy in worlds, under the names of these."""
    return [Tryout(lane=policy.lane, name=name, peak=policy.peak, dynamics=world) for name, world in worlds.items()]


def hard_tryouts(policy: PolicyId, quantities: Sequence[str], choosing: Peak | None = None) -> list[Tryout]:
    """Tryouts of one policy in hard worlds and in the task's own; see `hardened.in_world`."""
    worlds = hard_worlds(quantities)
    return tryouts(policy, {in_world(world, choosing): dynamics for world, dynamics in worlds.items()})


def hard_worlds(quantities: Sequence[str]) -> dict[str, Dynamics]:
    """The task's own world, and each of `HARD` that differs from it and the others in quantities that a robot has."""
    found: dict[str, Dynamics] = {OWN: NOMINAL}
    for name, world in HARD.items():
        known = {each: getattr(world, each) for each in quantities if getattr(world, each) != getattr(NOMINAL, each)}
        if known and Dynamics(**known) not in found.values():
            found[name] = Dynamics(**known)
    return found


def propose(lanes: Lanes, model: LanguageModel, robot: Robot, training: Hardening) -> dict[str, Ranges]:
    """Ranges by name, for each slot whose reply, or a repair of it, can be used."""
    config, store = lanes.config, lanes.store
    prompt = asked(robot, carries(store, training.policy.lane, robot.quantities), anew=training.anew)
    found: dict[int, Ranges] = {}
    wrong: dict[int, Prompt] = {}
    reason = ""
    for attempt in range(1 + config.repair):
        vacant = [slot for slot in range(config.sample) if slot not in found]
        if attempt:
            for slot in vacant:
                _draw(lanes, model, wrong[slot], attempt, [slot])
        else:
            _draw(lanes, model, prompt, attempt, vacant)
        replies = store.talk.proposals()
        for slot in vacant:
            reply = replies[slot, attempt].text
            try:
                found[slot] = robot.read(table_of(reply))
            except ConfigError as error:
                reason = str(error)
                said = prompts.clean(reason, prompts.MAX_BRIEF_FEEDBACK)
                request = f"These ranges cannot be used: {said}\n\nAnswer with the whole table."
                shown = prompts.clean(reply, prompts.MAX_PROGRAM)
                wrong[slot] = prompts.asked_again(wrong.get(slot, prompt), shown, request)
    if not found:
        raise ModelError(f"No reply contains usable ranges: {reason} Ask another model, or add repair=4.")
    return {f"r{slot}": found[slot] for slot in sorted(found)}


def _draw(lanes: Lanes, model: LanguageModel, prompt: Prompt, attempt: int, slots: Sequence[int]) -> None:
    """Ask for the replies that the store does not hold yet."""
    config, store = lanes.config, lanes.store
    missing = [slot for slot in slots if (slot, attempt) not in store.talk.proposals()]
    if not missing:
        return
    lanes.tell(Began("sample"))
    seed = request_seed(config.seed, config.generations, attempt, slots[0])
    for slot, reply in draw(model, prompt, slots, missing, seed, store.talk.paid(), config):
        store.talk.save_proposal(slot, attempt, prompt, reply)
        lanes.tell(Replied(slot, reply))


def table_of(reply: str) -> str:
    """The last code block of a reply, or the whole reply. Raises ConfigError for what is too long to be a table."""
    blocks = _BLOCK.findall(reply.replace("\r\n", "\n"))
    text = blocks[-1] if blocks else reply
    if len(text) > LONGEST:
        raise ConfigError(f"The reply is no table of ranges: it has {len(text)} characters.")
    return text


def asked(robot: Robot, carried: Sequence[Carried], *, anew: bool) -> Prompt:
    """The prompt: the robot, and where its policy still works."""
    lines: list[str] = []
    for one in carried:
        scores = ", ".join(f"{value:g}: {_share(share, fitness)}" for value, fitness, share in one.points)
        works = f"; works from {one.low:g} to {one.high:g}" if one.low is not None and one.high is not None else ""
        lines.append(f"- {one.name}: {scores}{works}")
    scales = {name: SCALES[name] for name in robot.quantities}
    ends = {name: _ends(name) for name in robot.quantities}
    text = prompts.template("robust").format(
        how="again from scratch" if anew else "on",
        task=robot.task,
        robot=plain(robot.description),
        keeps=KEEPS,
        sweep="\n".join(lines),
        quantities="\n".join(f"- {name} [{of.unit}], {of.least:g} to {of.most:g}" for name, of in scales.items()),
        example="\n".join(f"{name}: [{low[-2:][0]:g}, {high[:2][-1]:g}]" for name, (low, high) in [*ends.items()][:3]),
    )
    return Prompt(messages=(Message("user", text),), grammar=_table(ends))


def _ends(name: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Values that the grammar offers for the low and the high end of a range: the task's own and the grid beyond."""
    own = float(getattr(NOMINAL, name))
    return (*(v for v in GRID[name] if v < own), own), (own, *(v for v in GRID[name] if v > own))


def _table(ends: Mapping[str, tuple[Sequence[float], Sequence[float]]]) -> str:
    """GBNF of a table with a line for each quantity."""
    names = {name: name.replace("_", "-") for name in ends}
    rules = [f"root ::= {' '.join(names.values())}"]
    for name, (low, high) in ends.items():
        rule = names[name]
        rules.append(f'{rule} ::= "{name}: [" {rule}-low ", " {rule}-high "]\\n"')
        rules += [
            f"{rule}-{end} ::= " + " | ".join(f'"{v:g}"' for v in own)
            for end, own in zip(("low", "high"), (low, high), strict=True)
        ]
    return "\n".join(rules) + "\n"


def _share(share: float | None, fitness: float | None) -> str:
    text = "undefined" if fitness is None else f"{fitness:.3g}"
    return text if share is None else f"{text} ({share:.0%})"


def _peak(lanes: Lanes, lane: Lane, quantities: Sequence[str]) -> Peak:
    """Which of a lane's policies does best in hard worlds, on start states for choosing."""
    choosing = [tryout for peak in PEAKS for tryout in hard_tryouts(PolicyId(lane.id, peak), quantities, peak)]
    lanes.try_out(choosing, starts=CHOOSING, episodes=CHOOSING_EPISODES)
    found = chosen(lanes.store.lanes.tryouts().get(lane.id, {}), lanes.config.cost_limits)
    return (found.peak if found is not None else None) or PEAKS[0]


def _worth(lanes: Lanes, lane: str) -> tuple[float, float]:
    """Key to rank lanes by, on start states for choosing."""
    limits = lanes.config.cost_limits
    return worth(chosen(lanes.store.lanes.tryouts().get(lane, {}), limits), limits)


def written(ranges: Ranges) -> str:
    """Ranges as text that `randomise=FILE.yaml` reads."""
    return "".join(f"{name}: [{low:g}, {high:g}]\n" for name, (low, high) in ranges.drawn.items())
