"""How many cycles a policy spins the pen per episode: pre-trained, fine-tuned, and trained from scratch.

    python benchmarks/pen_spinning.py                                   # the full curriculum, three seeds; hours
    python benchmarks/pen_spinning.py --steps 1e9 --worlds 16384 --device cuda
    python benchmarks/pen_spinning.py --reward outputs/X/best/reward.py # a generated reward in place of the human one

*Pre-trained* is the policy after the curriculum's first stage (random goals), *fine-tuned* the one after its last,
*scratch* one that spent the steps of all stages on the waypoints. All are scored in 256 held-out episodes on the
waypoints, 12 of which are one cycle. `benchmarks/results/pen_spinning.json` is written after each of the two trainings;
what it holds is not repeated, and a training that is broken off leaves its state: the same command goes on. Generated
rewards get the original's bonus of 250 a goal, as in Eureka's experiment.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from baselines import machine, read, thinned, write

from openeureka.executors.local import LocalExecutor
from openeureka.reward.files import read as read_reward
from openeureka.runs.rewards import explain, judge
from openeureka.score import mean
from openeureka.store import StageFiles, artifacts
from openeureka.suite.dexterity.pen_in_hand import CYCLE
from openeureka.tasks import curriculum
from openeureka.tasks.registry import get
from openeureka.training.curriculum import CurriculumTrainer
from openeureka.types import LaneSpec, RewardProgram, TrainBudget, Trainer, TrainingProgress, TrainingResult

ENV, CURRICULUM = "shadow_hand_spin", "pen_spinning"
RESULTS = Path(__file__).parent / "results" / "pen_spinning.json"

Record = dict[str, Any]


def train(trainer: Trainer, specs: Sequence[LaneSpec], budget: TrainBudget) -> dict[str, TrainingResult]:
    """Results by lane id."""
    results = {}
    for message in trainer.train(ENV, specs, budget):
        if isinstance(message, TrainingProgress):
            best = ", ".join(f"{lane} {value:.3g}" for lane, value in message.fitness.items() if value is not None)
            print(f"\rEpoch {message.epoch}/{message.epochs}: {best}\033[K", end="", flush=True)
        else:
            results[message.lane] = message
    print()
    return results


def arm(trainer: Trainer, results: Mapping[str, TrainingResult], folder: Path) -> Record:
    """Cycles an episode, their mean, and every seed's steps and curves; leaves the policies.

    Policies are those at the end of training, as a curriculum goes on from them.
    """
    policies = {lane: result.last for lane, result in results.items() if result.last is not None}
    for lane, policy in policies.items():
        artifacts.write(folder, f"{lane}.safetensors", policy)
    scores = {score.lane: score for score in trainer.evaluate(ENV, policies, seed=0)}
    cycles = {lane: score.fitness / CYCLE for lane, score in scores.items() if score.fitness is not None}
    return {
        "cycles": mean(list(cycles.values())),
        "lanes": {
            lane: {
                "state": str(result.state),
                "cycles": cycles.get(lane),
                "episode_length": scores[lane].episode_length if lane in scores else None,
                "env_steps": result.env_steps,
                "minutes": round(result.seconds / 60, 2),
                "curves": thinned(result.curves),
            }
            for lane, result in results.items()
        },
    }


def through_the_curriculum(
    trainer: Trainer, specs: Sequence[LaneSpec], budget: TrainBudget, folder: Path
) -> dict[str, Record]:
    """The arms `pre_trained` and `fine_tuned`; the first stage is kept in the folder."""
    kept = StageFiles(folder)
    stages = curriculum.find(ENV, CURRICULUM)
    fine_tuned = train(CurriculumTrainer(trainer, stages, kept), specs, budget)
    pre_trained = {spec.id: result for spec in specs if (result := kept.read(1, spec.id)) is not None}
    return {
        "pre_trained": arm(trainer, pre_trained, folder / "pre_trained"),
        "fine_tuned": arm(trainer, fine_tuned, folder / "fine_tuned"),
    }


def from_scratch(trainer: Trainer, specs: Sequence[LaneSpec], budget: TrainBudget, folder: Path) -> dict[str, Record]:
    """The arm `scratch`."""
    return {"scratch": arm(trainer, train(trainer, specs, budget), folder / "scratch")}


PARTS = {("pre_trained", "fine_tuned"): through_the_curriculum, ("scratch",): from_scratch}


def program(reward: str) -> RewardProgram:
    """`human`, or the checked program of a reward file."""
    if reward == "human":
        return "human"
    (verdict,) = judge(ENV, [read_reward(Path(reward))], unsafe=False)
    if verdict.graph is None:
        raise SystemExit(f"{reward} was refused: {'; '.join(explain(verdict))}")
    return verdict.graph


def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--reward", default="human", help="human, or a reward file")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--steps", type=float, default=0, help="environment steps of a lane, over both stages")
    parser.add_argument("--worlds", type=int, default=0, help="worlds of a lane, 0 for the recipe's")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--policies", type=Path, default=Path("outputs/pen_spinning"), help="where policies are left")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args(words)

    steps = int(options.steps) or sum(stage.steps for stage in curriculum.find(ENV, CURRICULUM))
    worlds = options.worlds or get(ENV).recipe.worlds
    settings = {"reward": Path(options.reward).stem, "env_steps": steps, "worlds": worlds, "seeds": options.seeds}
    found = read(options.out)
    if any(found.get(key, value) != value for key, value in settings.items()):
        raise SystemExit(f"{options.out} holds another experiment; move it away or choose another --out.")
    found = {**settings, "arms": {}, **found}
    budget = TrainBudget(env_steps=steps, worlds=worlds, bonus=True)
    specs = [LaneSpec(id=f"s{seed}", program=program(options.reward), seed=seed) for seed in range(options.seeds)]
    folder = options.policies / "_".join(map(str, settings.values()))
    trainer = LocalExecutor(options.device, options.threads, snapshots=folder / "snapshots")
    for names, learn in PARTS.items():
        if not found["arms"].keys() >= set(names):
            found["arms"] |= {
                name: {**learned, **machine(options.device)}
                for name, learned in learn(trainer, specs, budget, folder).items()
            }
            write(options.out, found)
        for name in names:
            print(f"{name}: {found['arms'][name]['cycles']} cycles an episode")


if __name__ == "__main__":
    main()
