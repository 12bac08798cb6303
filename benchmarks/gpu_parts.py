"""What `gpu.py` measures: each part of one task on one device."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from functools import cache
from typing import Any

import torch
from lanes import PEAKS, record
from records import conditions
from throughput import RAW_EPISODE
from throughput import raw as raw_on_cpu
from torch.profiler import ProfilerActivity, profile

from openeureka.executors.local import LocalExecutor
from openeureka.llm.random import RandomModel
from openeureka.method import prompts
from openeureka.method.lanes import HELD_OUT
from openeureka.reward import extract
from openeureka.runs.rewards import judge
from openeureka.tasks import registry
from openeureka.tasks.context import context
from openeureka.testing.conformance.parity import compare
from openeureka.training.population import Population
from openeureka.types import (
    Candidate,
    Evaluation,
    LaneSpec,
    Peak,
    PromptPlan,
    RewardGraph,
    TrainBudget,
    TrainingResult,
    TrainingState,
)

WARM_UP = 3  # calls that load, compile and capture
ENDLESS = 10**12  # environment steps of a training that the clock ends

Found = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sizes:
    """How much every part does."""

    worlds: int
    """Worlds of a lane."""
    lanes: tuple[int, int, int]
    """Lanes of the trainings that are measured. The second number is also that of the human reward's seeds."""
    measure: float
    """[s] of steady state that a rate is measured over."""
    train: float
    """[s] of training with the human reward."""
    parity_steps: int


def machine(device: str) -> Found:
    """What the numbers are measured on."""
    told = conditions("mujoco-warp", "warp-lang")
    found: Found = {**told["machine"], "versions": told["versions"], "device": device}
    if device.startswith("cuda"):
        properties = torch.cuda.get_device_properties(device)
        found |= {"gpu": properties.name, "gpu_memory_gib": round(properties.total_memory / 2**30, 1)}
    return found


# --- simulation ------------------------------------------------------------------------------------------------------


def parity(env: str, device: str, sizes: Sizes) -> Found:
    """How far this device's simulator strays from the CPU's."""
    return {"differences": [asdict(found) for found in compare(env, device, sizes.parity_steps)]}


def raw(env: str, device: str, sizes: Sizes) -> Found:
    """Environment steps a second of the bare simulator: no observation, reward or policy."""
    worlds = max(sizes.lanes) * sizes.worlds
    if device == "cpu":
        return {"worlds": worlds, "steps_per_second": round(raw_on_cpu(env, worlds, steps=RAW_EPISODE))}
    before = _used_memory(device)
    step, check = _stepper(env, worlds, device)
    rate = _calls_per_second(step, device, sizes.measure)
    check()
    memory = (_used_memory(device) - before) / worlds
    return {"worlds": worlds, "steps_per_second": round(rate * worlds), "bytes_per_world": round(memory)}


def _stepper(env: str, worlds: int, device: str) -> tuple[Callable[[], None], Callable[[], None]]:
    """Two functions. The first takes a control step of mujoco_warp as its documentation does it, on a GPU as a graph
    that is captured once. The second raises CapacityError if contacts or constraints lacked room in any step so far."""
    import mujoco_warp as mjw
    import warp as wp

    from openeureka.sim.base import Capacity, capacity
    from openeureka.sim.warp import check_room

    task = registry.get(env)
    model = task.compile_model()
    room = capacity(model, Capacity(task.max_contacts, task.max_constraints))
    place = wp.get_device("cpu" if device == "warp-cpu" else device)
    with wp.ScopedDevice(place):
        warp_model = mjw.put_model(model)
        warp_model.opt.disableflags |= mjw.DisableBit.NATIVECCD  # the same contacts as in `sim/warp.py`
        warp_model.opt.warn_overflow = 0
        data = mjw.make_data(model, nworld=worlds, nconmax=room.contacts, njmax=room.constraints)
    ctrl, overflow = wp.to_torch(data.ctrl), wp.to_torch(data.overflow)
    lacked = torch.zeros_like(overflow)  # of the steps before the last reset, which clears `overflow`
    calls = 0

    def substeps() -> None:
        for _ in range(task.substeps):
            mjw.step(warp_model, data)

    with wp.ScopedDevice(place):
        substeps()
        mjw.reset_data(warp_model, data)
        graph = None
        if place.is_cuda:
            with wp.ScopedCapture() as capture:
                substeps()
            graph = capture.graph

    def step() -> None:
        nonlocal calls
        calls += 1
        with wp.ScopedDevice(place):
            if calls % RAW_EPISODE == 0:
                lacked.bitwise_or_(overflow)
                mjw.reset_data(warp_model, data)
            ctrl.uniform_(-1.0, 1.0)
            if graph is not None:
                wp.capture_launch(graph)
            else:
                substeps()

    return step, lambda: check_room((lacked | overflow).cpu().numpy(), room, env)


def environment(env: str, device: str, sizes: Sizes) -> Found:
    """Environment steps a second of the task with random actions."""
    lanes = max(sizes.lanes)
    simulation = registry.make(env, worlds=sizes.worlds, lane_seeds=range(lanes), device=device)
    simulation.reset(stagger=True)
    shape = (simulation.num_worlds, simulation.task.num_actions)

    def step() -> None:
        simulation.step(torch.rand(shape, device=simulation.sim.device) * 2.0 - 1.0)

    rate = _calls_per_second(step, device, sizes.measure)
    simulation.check()
    return {
        "worlds": simulation.num_worlds,
        "steps_per_second": round(rate * simulation.num_worlds),
        "broken_worlds": int(simulation.bad_total),
    }


def _calls_per_second(call: Callable[[], None], device: str, seconds: float) -> float:
    """The clock is read once in 16 calls, because the device must have finished for that."""
    for _ in range(WARM_UP):
        call()
    _finish(device)
    calls, began, passed = 0, time.perf_counter(), 0.0
    while passed < seconds:
        for _ in range(16):
            call()
        _finish(device)
        calls += 16
        passed = time.perf_counter() - began
    return calls / passed


def _finish(device: str) -> None:
    if device.startswith("cuda"):
        torch.cuda.synchronize(device)


def _used_memory(device: str) -> int:
    """[bytes] of the device, whoever uses them; 0 on the CPU."""
    if not device.startswith("cuda"):
        return 0
    free, total = torch.cuda.mem_get_info(device)
    return total - free


# --- training --------------------------------------------------------------------------------------------------------


def training(env: str, device: str, sizes: Sizes, lanes: int, processes: int) -> Found:
    """Environment steps a second of training, network updates included, from the moment all processes are under way."""
    programs = rewards(env, max(sizes.lanes))[:lanes]
    specs = _lanes(programs)
    budget = TrainBudget(worlds=sizes.worlds, env_steps=ENDLESS)
    steps_per_epoch = sizes.worlds * registry.get(env).recipe.horizon * lanes // processes
    called, began, epochs = time.perf_counter(), 0.0, 0
    with closing(LocalExecutor(",".join([device] * processes)).train(env, specs, budget)) as stream:
        for message in stream:
            now = time.perf_counter()
            if isinstance(message, TrainingResult):
                raise RuntimeError(message.message or "the training ended before it was measured")
            if not began and len(message.fitness) == lanes:
                began, epochs = now, message.epoch
            elif began and now - began >= sizes.measure and message.epoch > epochs:
                return {
                    "worlds": sizes.worlds * lanes,
                    "steps_per_second": round((message.epoch - epochs) * steps_per_epoch / (now - began)),
                    "seconds_to_begin": round(began - called, 1),
                    "nodes_per_reward": statistics.mean(len(program.nodes) for program in programs),
                }
    raise RuntimeError("the training said nothing")


def epoch(env: str, device: str, sizes: Sizes) -> Found:
    """[s] of an epoch of training, and what torch's profiler says of the next ones, which it slows down."""
    specs = _lanes(rewards(env, max(sizes.lanes)))
    trained = Population(env, specs, TrainBudget(worlds=sizes.worlds, env_steps=ENDLESS), device=device)
    stream = trained.train()
    next(stream)
    _finish(device)
    before, began = trained.epoch, time.perf_counter()
    while time.perf_counter() - began < sizes.measure:
        next(stream)
    _finish(device)
    seconds = (time.perf_counter() - began) / (trained.epoch - before)
    before = trained.epoch
    with profile(activities=[ProfilerActivity.CPU, ProfilerActivity.CUDA]) as profiled:
        next(stream)
        _finish(device)
    events, epochs = profiled.key_averages(), trained.epoch - before
    counts = {event.key: event.count / epochs for event in events}
    return {
        "seconds_of_an_epoch": round(seconds, 4),
        "seconds_of_the_device": round(sum(event.self_device_time_total for event in events) / 1e6 / epochs, 4),
        "launches": round(counts.get("cudaLaunchKernel", 0)),
        "waits": round(counts.get("cudaStreamSynchronize", 0), 1),
        "steps": trained.horizon,
    }


def _lanes(programs: Sequence[RewardGraph]) -> list[LaneSpec]:
    """One lane per program, each with its own seed."""
    return [LaneSpec(id=str(seed), program=program, seed=seed) for seed, program in enumerate(programs)]


@cache
def rewards(env: str, count: int) -> list[RewardGraph]:
    """Programs such as a search trains: random ones of the typed grammar, all different."""
    prompt = prompts.render(context(env), PromptPlan(count=count), "grammar")
    replies = RandomModel().sample(prompt, n=4 * count, seed=0)
    candidates = [Candidate.of(extract.program(reply.text) or "") for reply in replies]
    # The grammar knows no call that could do harm, so a kernel without confinement will do.
    graphs = [verdict.graph for verdict in judge(env, candidates, unsafe=True) if verdict.graph is not None]
    if len(graphs) < count:
        raise RuntimeError(f"only {len(graphs)} of {4 * count} random rewards were accepted")
    return graphs[:count]


def human(env: str, device: str, sizes: Sizes, rate: float) -> Found:
    """Train the human reward for about `sizes.train` seconds; `rate` [environment steps/s] turns these into steps."""
    seeds = sizes.lanes[1]
    specs = [LaneSpec(id=f"human-s{seed}", program="human", seed=seed) for seed in range(seeds)]
    budget = TrainBudget(worlds=sizes.worlds, env_steps=round(rate * sizes.train / seeds))
    trainer = LocalExecutor(device)
    began = time.perf_counter()
    results = [message for message in trainer.train(env, specs, budget) if isinstance(message, TrainingResult)]
    seconds = time.perf_counter() - began
    if failed := [result.message for result in results if result.state is TrainingState.FAILED]:
        raise RuntimeError(failed[0])
    scores: dict[str, dict[Peak, Evaluation]] = {result.lane: {} for result in results}
    for peak in PEAKS:
        policies = {result.lane: result.policies.get(f"best_{peak}", b"") for result in results}
        held_out = trainer.evaluate(env, {lane: data for lane, data in policies.items() if data}, seed=HELD_OUT)
        for score in held_out:
            scores[score.lane][peak] = score
    return {
        "worlds": sizes.worlds * seeds,
        "seconds_of_training": round(results[0].seconds, 1),
        "seconds_with_start": round(seconds, 1),
        "lanes": {result.lane: record(result, scores[result.lane]) for result in results},
    }
