"""What the samples of a language model are worth: how many can be trained, how different they are, what F they reach.

    python benchmarks/local_model.py                                   # five tasks, model and control; hours on 2 cores
    python benchmarks/local_model.py --env ant --model local --no-train # one look, without training; kept nowhere

An arm is the first generation of a search (`outputs/local_model/TASK/MODEL`): every accepted program trains as one lane
of one population, besides the human and the sparse reward, with the same seed. `random` draws from the model's grammar
without a model and is the control. The same command goes on where it was broken off, and asks for no reply twice.
"""

from __future__ import annotations

import argparse
import ast
import re
import statistics
from pathlib import Path
from typing import Any

from records import OUTPUTS, Record, amount, command_line, keep, machine, read, results

import openeureka
from openeureka.errors import EurekaError
from openeureka.events import Began, Event
from openeureka.report.build import build
from openeureka.report.view import RunView
from openeureka.tasks import registry
from openeureka.types import Generation, TrainingProgress, lane_id

STEPS = {"cartpole": 3e5, "ballbalance": 4e5, "quadcopter": 6e5, "ant": 6e5, "humanoid": 5e5}  # of a lane
SAMPLE = 16
"""Samples of each arm."""
TEMPERATURE = 1.0


class Enough(Exception):
    """The search has come as far as it is measured."""


def first_generation(env: str, model: str, options: argparse.Namespace) -> RunView:
    """The first samples of a search as published, trained where that is wanted."""

    def tell(event: Event) -> None:
        if isinstance(event, TrainingProgress):
            print(f"\r{env}, {model}: epoch {event.epoch}/{event.epochs}\033[K", end="", flush=True)
        before = isinstance(event, Began) and event.phase == "train"
        if isinstance(event, Generation) or (before and not options.train):
            raise Enough

    directory = OUTPUTS / "local_model" / env / re.sub(r"\W+", "_", model)
    try:
        openeureka.search(
            env,
            model=model,
            search="eureka",
            sample=SAMPLE,
            iteration=1,
            refill=0,
            temperature=TEMPERATURE,
            seed=options.seed,
            steps=options.steps or STEPS.get(env, 0),
            video="none",
            dir=directory,
            on_event=tell,
        )
    except Enough:
        build(directory, "none", env)
        return RunView.read(directory)
    except EurekaError as error:
        raise SystemExit(str(error)) from None
    raise SystemExit("The same command goes on.")


def report(arm: RunView) -> dict[str, Any]:
    accepted = [slot for slot in arm.candidates if slot.verdict is not None and slot.verdict.accepted]
    reached = sorted((slot.fitness for slot in accepted if slot.fitness is not None), reverse=True)
    sources = {slot.program.source for slot in arm.candidates if slot.program is not None}
    replies = [attempt.reply for slot in arm.candidates for attempt in slot.attempts]
    return {
        "samples": len(replies),
        "accepted": len(accepted),
        "texts": len(sources),
        "programs_beyond_comments": len({_code(source) for source in sources}),
        "seconds_a_sample": round(statistics.mean(reply.seconds for reply in replies), 2),
        "tokens_a_sample": round(statistics.mean(reply.usage.completion_tokens for reply in replies)),
        "fitness": {
            "best": reached[0] if reached else None,
            "median": statistics.median(reached) if reached else None,
            "all": [round(value, 4) for value in reached],
        },
    }


def _code(source: str) -> str:
    """The program without comments and layout, as far as it parses."""
    try:
        return ast.unparse(ast.parse(source))
    except SyntaxError:
        return source


def measure(env: str, options: argparse.Namespace) -> dict[str, Any]:
    arms = {model: first_generation(env, model, options) for model in options.model or ("local", "random")}
    for model, arm in arms.items():
        for slot in arm.candidates:
            if slot.program is not None and slot.verdict is not None:
                reasons = "".join(f"\n# {finding.sentence()}" for finding in slot.verdict.findings)
                print(f"# {env}, {model}: {slot.verdict.code}{reasons}\n{slot.program.source}\n")
    one = next(iter(arms.values()))
    human = one.results.get(lane_id("human", options.seed))
    return {
        **shared(env, options),
        "human": human.fitness if human is not None else None,
        "arms": {model: {**report(arm), **machine("cpu")} for model, arm in arms.items()},
    }


def shared(env: str, options: argparse.Namespace) -> Record:
    """The settings that all arms of a row have."""
    steps = options.steps or STEPS.get(env) or registry.get(env).recipe.env_steps
    return {"seed": options.seed, "temperature": TEMPERATURE, "env_steps_per_lane": steps}


def joined(known: Record, found: Record) -> Record:
    """A row with these arms, and with those that it has of other models."""
    return {**known, **found, "arms": known.get("arms", {}) | found["arms"]}


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--env", action="append", choices=registry.names(), help="a task; may be repeated")
    parser.add_argument("--model", action="append", help="an arm as `model=` names it; may be repeated")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=amount, default=0, help="environment steps of a lane, 0 for a short budget")
    parser.add_argument("--train", action=argparse.BooleanOptionalAction, default=True)
    parser.add_argument("--out", type=Path, default=results("local_model"))
    options = parser.parse_args()
    for env in options.env or STEPS:
        known, wanted = read(options.out).get(env, {}), shared(env, options)
        if options.train and any(known.get(name, value) != value for name, value in wanted.items()):
            had = ", ".join(f"{name} {known[name]}" for name in wanted)
            raise SystemExit(f"{env} was measured with {had}; name another file with --out.")
        found = measure(env, options)
        if options.train:
            keep(options.out, env, joined(known, found))
        for model, arm in found["arms"].items():
            accepted, fitness = f"{arm['accepted']} of {arm['samples']} accepted", arm["fitness"]
            print(f"{env}, {model}: {accepted}, F best {fitness['best']}, median {fitness['median']}")
        print(f"{env}, human: F {found['human']}", flush=True)


if __name__ == "__main__":
    main()
