"""What the samples of a language model are worth: how many can be trained, how different they are, what F they reach.

    python benchmarks/local_model.py                                   # five tasks, model and control; hours on 2 cores
    python benchmarks/local_model.py --env ant --model local --no-train # one look, without training

Every accepted program of every arm trains as one lane of one population, beside the human reward, with the same seed;
`random` draws from the model's grammar without a model and is the control. Each task's result is written when done.
"""

from __future__ import annotations

import argparse
import ast
import dataclasses
import json
import os
import platform
import statistics
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from openeureka import prompts
from openeureka.config import RunConfig
from openeureka.executors.local import LocalExecutor
from openeureka.llm import open_model
from openeureka.reward import extract
from openeureka.sandbox.client import Sandbox
from openeureka.tasks import registry
from openeureka.tasks.context import context
from openeureka.tasks.record import record_states
from openeureka.types import (
    Candidate,
    LaneSpec,
    PromptPlan,
    RewardProgram,
    TrainBudget,
    TrainingProgress,
    TrainingResult,
    Verdict,
)

RESULTS = Path(__file__).parent / "results"
STEPS = {"cartpole": 3e5, "ballbalance": 4e5, "quadcopter": 6e5, "ant": 6e5, "humanoid": 5e5}  # of a lane


@dataclasses.dataclass(frozen=True, slots=True)
class Drawn:
    """The samples of one arm."""

    count: int
    """Samples that were asked for; those without a program have no verdict."""
    seconds: float
    """Loading included."""
    tokens: int
    sources: tuple[str, ...]
    verdicts: tuple[Verdict, ...]


def draw(config: RunConfig, count: int) -> Drawn:
    """First-generation samples and what gate and sandbox say of them."""
    known = context(config.env)
    model = open_model(config)
    prompt = prompts.render(known, PromptPlan(count=count), model.style)
    began = time.monotonic()
    try:
        replies = list(model.sample(prompt, n=count, seed=config.seed))
    finally:
        model.close()
    seconds = time.monotonic() - began
    sources = tuple(source for reply in replies if (source := extract.program(reply.text)) is not None)
    with Sandbox(known.state, record_states(config.env), unsafe=config.unsafe_no_sandbox) as sandbox:
        verdicts = tuple(sandbox.check(Candidate.of(source)) for source in sources)
    return Drawn(count, seconds, sum(reply.usage.completion_tokens for reply in replies), sources, verdicts)


def train(env: str, drawn: dict[str, Drawn], steps: int, seed: int) -> dict[str, TrainingResult]:
    """Results by `human` and candidate id; equal programs train once for each text."""
    wanted: dict[str, RewardProgram] = {"human": "human"}
    for arm in drawn.values():
        wanted |= {verdict.candidate: verdict.graph for verdict in arm.verdicts if verdict.graph is not None}
    results: dict[str, TrainingResult] = {}
    specs = [LaneSpec(id=name, program=program, seed=seed) for name, program in wanted.items()]
    for message in LocalExecutor().train(env, specs, TrainBudget(env_steps=steps)):
        if isinstance(message, TrainingProgress):
            print(f"\r{env}: epoch {message.epoch}/{message.epochs}\033[K", end="", flush=True)
        else:
            results[message.lane] = message
    print()
    return results


def report(arm: Drawn, results: dict[str, TrainingResult]) -> dict[str, Any]:
    accepted = [verdict for verdict in arm.verdicts if verdict.accepted]
    fitness = [results[verdict.candidate].fitness for verdict in accepted if verdict.candidate in results]
    reached = sorted((value for value in fitness if value is not None), reverse=True)
    return {
        "samples": arm.count,
        "accepted": len(accepted),
        "texts": len(set(arm.sources)),
        "programs_beyond_comments": len({_code(source) for source in arm.sources}),
        "seconds_a_sample": round(arm.seconds / arm.count, 2),
        "tokens_a_sample": round(arm.tokens / arm.count),
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


def measure(env: str, models: Sequence[str], options: argparse.Namespace) -> dict[str, Any]:
    drawn: dict[str, Drawn] = {}
    for model in models:
        config = RunConfig(env=env, model=model, seed=options.seed, temperature=options.temperature)
        drawn[model] = draw(config, options.sample)
        for source, verdict in zip(drawn[model].sources, drawn[model].verdicts, strict=True):
            reasons = "".join(f"\n# {finding.sentence()}" for finding in verdict.findings)
            print(f"# {env}, {model}: {verdict.code}{reasons}\n{source}\n")
    steps = int(options.steps or STEPS.get(env, 0))
    results = train(env, drawn, steps, options.seed) if options.train else {}
    return {
        "date": datetime.now(UTC).date().isoformat(),
        "device": f"{os.cpu_count()} cores, {platform.machine()}",
        "versions": {name: version(name) for name in ("torch", "mujoco")},
        "seed": options.seed,
        "temperature": options.temperature,
        "env_steps_per_lane": steps or registry.get(env).recipe.env_steps,
        "human": results["human"].fitness if results else None,
        "arms": {model: report(arm, results) for model, arm in drawn.items()},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", action="append", choices=registry.names(), help="a task; may be repeated")
    parser.add_argument("--model", action="append", help="an arm as `model=` names it; may be repeated")
    parser.add_argument("--sample", type=int, default=16, help="samples of an arm")
    parser.add_argument("--temperature", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=float, default=0, help="environment steps of a lane, 0 for a short budget")
    parser.add_argument("--train", action=argparse.BooleanOptionalAction, default=True)
    parser.add_argument("--out", type=Path, default=RESULTS / "local_model.json")
    options = parser.parse_args()
    found = json.loads(options.out.read_text()) if options.out.exists() else {}
    for env in options.env or STEPS:
        found[env] = measure(env, options.model or ("local", "random"), options)
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(json.dumps(found, indent=1) + "\n")
        for model, arm in found[env]["arms"].items():
            accepted, fitness = f"{arm['accepted']} of {arm['samples']} accepted", arm["fitness"]
            print(f"{env}, {model}: {accepted}, F best {fitness['best']}, median {fitness['median']}")
        print(f"{env}, human: F {found[env]['human']}", flush=True)


if __name__ == "__main__":
    main()
