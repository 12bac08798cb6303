"""How many cycles a policy spins the pen per episode: pre-trained, fine-tuned, and trained from scratch.

    python benchmarks/pen_spinning.py                                   # the full curriculum, three seeds; hours
    python benchmarks/pen_spinning.py --steps 1e9 --worlds 16384 --device cuda
    python benchmarks/pen_spinning.py --reward outputs/X/best/reward.py # a generated reward in place of the human one

*Pre-trained* is the policy after the curriculum's first stage (random goals), *fine-tuned* the one after its last,
*scratch* one that spent the steps of all stages on the waypoints. All are scored in 256 held-out episodes on the
waypoints, 12 of which are one cycle. Both trainings are runs such as `eureka train` makes, under
`outputs/pen_spinning/`: the same command goes on where one was broken off, and `eureka ui` shows them.
`benchmarks/results/pen_spinning.json` is written after each, and what it holds is not repeated. Generated rewards get
the original's bonus of 250 a goal, as in Eureka's experiment.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from lanes import thinned
from ledger import Learned, learn
from records import OUTPUTS, Record, amount, command_line, machine, read, results, write

from openeureka.config import TrainConfig
from openeureka.method.lanes import HELD_OUT
from openeureka.numbers import number
from openeureka.reward import extract
from openeureka.runs.trainers import trainer_of
from openeureka.stats import mean
from openeureka.store import StageFiles
from openeureka.suite.dexterity.pen_in_hand import CYCLE
from openeureka.tasks import curriculum
from openeureka.tasks.registry import get
from openeureka.types import Evaluation, TrainingResult

ENV, CURRICULUM = "shadow_hand_spin", "pen_spinning"
RESULTS = results("pen_spinning")


def arm(results: Mapping[str, TrainingResult], scores: Mapping[str, Evaluation]) -> Record:
    """Cycles an episode, their mean, and every seed's steps and curves."""
    cycles = {lane: score.fitness / CYCLE for lane, score in scores.items() if score.fitness is not None}
    return {
        "cycles": mean(list(cycles.values())),
        "lanes": {
            f"s{lane.rpartition('-s')[2]}": {
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


def last(learned: Learned) -> Record:
    """The arm of the policies at the end of training, from which a curriculum goes on."""
    scores = {lane: held_out["last"] for lane, (_, held_out) in learned.items() if "last" in held_out}
    return arm({lane: result for lane, (result, _) in learned.items()}, scores)


def first(config: TrainConfig, lanes: Sequence[str]) -> Record:
    """The same for the policies after the curriculum's first stage, played in the task itself."""
    kept = StageFiles(Path(config.dir))
    results = {lane: result for lane in lanes if (result := kept.read(1, lane)) is not None}
    policies = {lane: result.last for lane, result in results.items() if result.last is not None}
    trainer = trainer_of(config.run_config(), Path(config.dir))
    return arm(results, {score.lane: score for score in trainer.evaluate(ENV, policies, seed=config.seed + HELD_OUT)})


def through_the_curriculum(config: TrainConfig) -> dict[str, Record]:
    """The arms `pre_trained` and `fine_tuned`."""
    config = replace(config, curriculum=CURRICULUM, dir=f"{config.dir}/curriculum")
    learned = learn(config, ("last",))
    return {"pre_trained": first(config, list(learned)), "fine_tuned": last(learned)}


def from_scratch(config: TrainConfig) -> dict[str, Record]:
    """The arm `scratch`."""
    return {"scratch": last(learn(replace(config, dir=f"{config.dir}/scratch"), ("last",)))}


PARTS = {("pre_trained", "fine_tuned"): through_the_curriculum, ("scratch",): from_scratch}


CALLED = {"pre_trained": "pre-trained on random goals", "fine_tuned": "fine-tuned", "scratch": "from scratch"}
TITLES = ("policy", "cycles an episode, held out", "waypoints an episode in training, best")


def rows(found: Record) -> list[tuple[str, str, str]]:
    """One row per policy; the goals of the first stage are no waypoints."""
    return [
        (name, number(found["arms"][key]["cycles"], 2), _best(found["arms"][key]) if key != "pre_trained" else "-")
        for key, name in CALLED.items()
        if key in found["arms"]
    ]


def _best(own: Record) -> str:
    """The highest F of an epoch, mean over seeds."""
    curves = [lane["curves"]["fitness"] for lane in own["lanes"].values()]
    return number(mean([max((value for value in curve if value is not None), default=None) for curve in curves]), 2)


def summary(found: Record) -> str:
    """Whether the curriculum is worth its first stage."""
    tuned, scratch = (found["arms"][key]["cycles"] for key in ("fine_tuned", "scratch"))
    seeds = "one seed, which is no proof" if found["seeds"] == 1 else f"{found['seeds']} seeds"
    return (
        f"{'Yes' if tuned > scratch else 'No'}, with {found['env_steps']:,} steps and {seeds}: after both stages the "
        f"pen spins {number(tuned, 2)} times an episode, after a training from scratch {number(scratch, 2)} times."
    )


def called(reward: str) -> str:
    """`human`, or which program a file holds: many files have one name, such as `best/reward.py`."""
    return reward if reward == "human" else extract.in_file(Path(reward))[0].id


def main(words: Sequence[str] | None = None) -> None:
    parser = command_line(__doc__)
    parser.add_argument("--reward", default="human", help="human, or a reward file")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--steps", type=amount, default=0, help="environment steps of a lane, over both stages")
    parser.add_argument("--worlds", type=int, default=0, help="worlds of a lane, 0 for the recipe's")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--dir", type=Path, default=OUTPUTS / "pen_spinning", help="where the runs are kept")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args(words)

    steps = options.steps or sum(stage.steps for stage in curriculum.find(ENV, CURRICULUM))
    worlds = options.worlds or get(ENV).recipe.worlds
    settings = {"reward": called(options.reward), "env_steps": steps, "worlds": worlds, "seeds": options.seeds}
    found = read(options.out)
    if any(found.get(key, value) != value for key, value in settings.items()):
        raise SystemExit(f"{options.out} holds another experiment; move it away or choose another --out.")
    found = {**settings, "arms": {}, **found}
    config = TrainConfig(
        env=ENV,
        reward=options.reward,
        seeds=options.seeds,
        steps=steps,
        worlds=worlds,
        bonus="original",
        device=options.device,
        threads=options.threads,
        dir=str(options.dir / "_".join(map(str, settings.values()))),
    )
    for names, train in PARTS.items():
        if not found["arms"].keys() >= set(names):
            found["arms"] |= {name: {**learned, **machine(options.device)} for name, learned in train(config).items()}
            write(options.out, found)
        for name in names:
            print(f"{name}: {found['arms'][name]['cycles']} cycles an episode")


if __name__ == "__main__":
    main()
