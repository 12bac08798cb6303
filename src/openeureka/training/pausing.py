"""A lane leaves its population, and goes on in another: its part of the state, cut out and put back.

So it is where lanes pause at a rung, and where what is under way is stopped: those without a result go on alone.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

if TYPE_CHECKING:
    from .population import Population

State = dict[str, Any]
"""Of one lane, or of all, as `Population.state_dict` makes it."""


def save(state: State) -> bytes:
    """Tensors, numbers and text alone, as PyTorch writes them."""
    file = io.BytesIO()
    torch.save(state, file)
    return file.getvalue()


def load(data: bytes, device: torch.device) -> State:
    """Inverse of `save`. What anybody else made of it can run nothing."""
    return torch.load(io.BytesIO(data), map_location=device, weights_only=True)


def kind(state: State) -> str:
    """Of the device that a state was left on; an older version, which did not say, never ran on a GPU."""
    return state.get("device", "cpu")


def snapshot(population: Population) -> bytes:
    """The states of all lanes, by id."""
    state = population.state_dict()
    return save({spec.id: cut(population, lane, state) for lane, spec in enumerate(population.specs)})


def resume(population: Population, data: bytes) -> None:
    """Have a new population go on from a snapshot of these lanes, or of more."""
    lanes = load(data, population.device)
    put(population, [lanes[spec.id] for spec in population.specs])


def cut(population: Population, lane: int, state: State | None = None) -> State:
    """The state of one lane (axis of length 1), copied: worlds, policy, optimiser, noise, visits and what it showed.

    Args:
        state: that of the population, where it is known.
    """
    state, n = state or population.state_dict(), population.worlds
    task, own_parts = population.env.task, [own == lane for own, _ in population.curves.components]

    def own(value: Tensor) -> Tensor:
        return value[lane : lane + 1].clone()

    def worlds(value: Tensor) -> Tensor:
        return value[lane * n : (lane + 1) * n].clone()

    env, ppo, curves = state["env"], state["ppo"], state["curves"]
    return {
        **{name: state[name] for name in ("device", "epoch", "seconds", "clock")},
        "observation": own(state["observation"]),
        "env": {
            **{name: worlds(env[name]) for name in ("whole", "draws")},
            "task": {name: worlds(env["task"][name]) for name in task.lasting()},
            **{
                part: {name: worlds(value) for name, value in env[part].items()}
                for part in ("sim", "random")
                if part in env
            },
        },
        "ppo": {
            **{name: own(ppo[name]) for name in ("network", "active", "learning_rate")},
            **{name: {key: own(value) for key, value in ppo[name].items()} for name in ("observations", "values")},
            "moments": tuple(own(value) for value in ppo["moments"]),
            "updates": ppo["updates"],
            "generators": [ppo["generators"][population.ppo.streams[lane]]],
        },
        "curves": {
            "curves": [curves["curves"][lane]],
            "scores": [own(scores) for scores in curves["scores"]],
            "where": own(curves["where"]),
            "moments": own(curves["moments"]),
            "parts": curves["parts"][own_parts],
        },
        "rewards": {name: own(value) for name, value in state["rewards"].items()},
        "peaks": [[peaks[lane]] for peaks in state["peaks"]],
        **{name: [state[name][lane]] for name in ("messages", "trained")},
    }


def put(population: Population, lanes: Sequence[State]) -> None:
    """Have a new population go on where its lanes paused, all at the same epoch; what they share is the slowest's."""
    state = population.state_dict()

    def joined(get: Callable[[State], Tensor]) -> Tensor:
        return torch.cat([get(lane) for lane in lanes])

    def listed(get: Callable[[State], list[Any]]) -> list[Any]:
        return [value for lane in lanes for value in get(lane)]

    slowest = max(lanes, key=lambda lane: lane["seconds"])
    state |= {name: slowest[name] for name in ("epoch", "seconds", "clock")}
    state["observation"] = joined(lambda lane: lane["observation"])
    for part in ("env", "ppo"):
        state[part] |= _joined([lane[part] for lane in lanes], {**state[part]})
    streams = dict(zip(population.ppo.streams, listed(lambda lane: lane["ppo"]["generators"]), strict=True))
    fresh = state["curves"]["where"][:1]
    state["ppo"]["generators"] = [streams[stream] for stream in range(len(streams))]
    state["curves"] |= {
        "curves": listed(lambda lane: lane["curves"]["curves"]),
        "scores": [torch.cat(step) for step in zip(*(lane["curves"]["scores"] for lane in lanes), strict=True)],
        "where": joined(lambda lane: lane["curves"].get("where", fresh)),  # an older version saved none
        "moments": joined(lambda lane: lane["curves"]["moments"]),
        "parts": joined(lambda lane: lane["curves"]["parts"]),
    }
    # An older version saved none of it, and knew no bonus that needs it.
    state["rewards"] |= _joined([lane.get("rewards", {}) for lane in lanes], state["rewards"])
    state["peaks"] = [listed(lambda lane, which=which: lane["peaks"][which]) for which in range(2)]
    state |= {name: listed(lambda lane, name=name: lane[name]) for name in ("messages", "trained")}
    population.load_state_dict(state)


def _joined(parts: Sequence[State], whole: State) -> State:
    """Tensors of all lanes one after the other, at every depth; of numbers, which are equal, the first."""
    found: State = {}
    for name, first in parts[0].items():
        if isinstance(first, Tensor):
            found[name] = torch.cat([part[name] for part in parts])
        elif isinstance(first, tuple):
            found[name] = tuple(torch.cat([part[name][i] for part in parts]) for i in range(len(first)))
        elif isinstance(first, dict):
            found[name] = {**whole[name], **_joined([part[name] for part in parts], whole[name])}
        else:
            found[name] = first
    return found
