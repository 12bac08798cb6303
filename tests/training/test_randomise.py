"""Training worlds that differ: what is drawn, what a policy experiences, and that lanes do not affect each other."""

import dataclasses
from pathlib import Path

import mujoco
import pytest
import torch

from openeureka.config import RunConfig
from openeureka.errors import ConfigError
from openeureka.events import nobody
from openeureka.method.lanes import Lanes
from openeureka.store import Store
from openeureka.tasks import registry
from openeureka.tasks.randomise import RandomisedEnv
from openeureka.tasks.ranges import NAMED, find, ranges, useless
from openeureka.testing.scripted import ToyTrainer
from openeureka.training import population
from openeureka.training.population import Population
from openeureka.training.wire import pack_lanes, unpack_lanes
from openeureka.types import NOMINAL, Lane, LaneSpec, Ranges, TrainBudget, TrainingProgress, TrainingResult
from openeureka.types.dynamics import QUANTITIES

PENDULUM = str(Path(__file__).parents[2] / "examples" / "pendulum.py")
SAME = Ranges(NOMINAL, NOMINAL)
HARD = ranges({"mass": (0.5, 2.0), "strength": (0.7, 1.3), "delay": (0.0, 0.06), "noise": (0.0, 0.1)})
SMALL = TrainBudget(env_steps=16 * 32 * 4, worlds=32)


def made(env: str, drawn: Ranges, worlds: int = 8, lanes: int = 1) -> RandomisedEnv:
    found = registry.make(env, worlds=worlds, lane_seeds=[3] * lanes, threads=1, ranges=[drawn] * lanes)
    assert isinstance(found, RandomisedEnv)
    return found


def trained(budget: TrainBudget, *names: str) -> dict[str, TrainingResult]:
    specs = [LaneSpec(id=name, program="human") for name in names or ("a",)]
    messages = Population("cartpole", specs, budget, threads=1).train()
    return {m.lane: dataclasses.replace(m, seconds=0.0) for m in messages if isinstance(m, TrainingResult)}


def test_worlds_that_draw_nothing_train_to_the_same_bits():
    assert trained(dataclasses.replace(SMALL, randomise=SAME)) == trained(SMALL)
    assert trained(dataclasses.replace(SMALL, randomise=HARD)) != trained(SMALL)


def test_lanes_see_the_same_worlds_whatever_their_policies_do():
    env = made("cartpole", HARD, lanes=2)
    env.reset()
    seen: list[list[torch.Tensor]] = [[env.worlds[i].clone()] for i in range(16)]
    generator = torch.Generator().manual_seed(0)
    for _ in range(150):
        actions = torch.cat((torch.zeros(8, 1), 2 * torch.rand(8, 1, generator=generator) - 1))
        done = env.step(actions).done
        for i in done.nonzero().flatten().tolist():
            seen[i].append(env.worlds[i].clone())
    assert {len(own) != len(other) for own, other in zip(seen[:8], seen[8:], strict=True)} & {True}
    for own, other in zip(seen[:8], seen[8:], strict=True):
        assert all(torch.equal(a, b) for a, b in zip(own, other, strict=False))
    masses = torch.stack([world[0] for own in seen for world in own])
    assert 0.5 <= float(masses.min()) < 0.8 and 1.7 < float(masses.max()) <= 2.0


def test_a_quantity_is_drawn_the_same_whatever_else_is():
    one, other = made("cartpole", HARD), made("cartpole", ranges({"mass": (0.5, 2.0)}))
    for env in (one, other):
        env.reset()
    assert torch.equal(one.quantity("mass"), other.quantity("mass"))


def test_noise_is_the_same_whatever_is_pushed_beside_it():
    noisy, pushed = ranges({"noise": (0.1, 0.1)}), ranges({"push": (0.5, 0.5)})
    seen: list[torch.Tensor] = []
    for beside in (noisy, pushed):
        env = registry.make("ant", worlds=2, lane_seeds=[1, 2], ranges=[noisy, beside])
        env.reset()
        env.step(torch.zeros(4, 8))
        seen.append(env.step(torch.zeros(4, 8)).observation[:2])
    assert torch.equal(*seen)


def test_the_model_is_what_was_drawn_and_changes_with_the_episode():
    env = made("cartpole", HARD)
    env.reset()
    before = env.quantity("mass").clone()
    own = torch.from_numpy(env.sim.model.body_mass).float()
    torch.testing.assert_close(env.sim.expand("body_mass"), before[:, None] * own)  # type: ignore[attr-defined]
    env._reset(torch.tensor([2]))
    assert (env.quantity("mass") != before).tolist() == [i == 2 for i in range(8)]
    torch.testing.assert_close(env.sim.expand("body_mass"), env.quantity("mass")[:, None] * own)


def test_an_action_is_acted_on_after_the_delay(monkeypatch: pytest.MonkeyPatch):
    # Cartpole acts every 1/60 s: 40 ms are 2.4 steps, which is 2.
    env = made("cartpole", ranges({"delay": (0.04, 0.04)}), worlds=1)
    env.reset()
    acted: list[float] = []
    apply = env.task.apply_action
    monkeypatch.setattr(env.task, "apply_action", lambda a: (acted.append(round(float(a), 3)), apply(a)))
    asked: list[float] = []
    for x in (0.1, 0.2, 0.3):
        env.step(torch.tensor([[x]]))
        asked.append(round(float(env.task.actions), 3))
    env._reset(torch.tensor([0]))
    env.step(torch.tensor([[0.4]]))
    assert asked == [0.1, 0.2, 0.3] and acted == [0.0, 0.0, 0.1, 0.0]


def test_a_delay_of_half_a_step_too_many_finds_its_action():
    # ANYmal acts every 0.02 s, so 0.09 s are 4.5 steps: rounded to 5 in single precision, to 4 in double precision.
    env = made("anymal", ranges({"delay": (0.09, 0.09)}), worlds=1)
    assert env._asked.shape[1] == 1 + 5
    env.reset()
    assert bool(env.step(torch.zeros(1, 12)).observation.isfinite().all())


def test_noise_is_the_policys_alone_and_as_large_as_drawn():
    env = made("cartpole", ranges({"noise": (0.1, 0.1)}), worlds=200)
    env.reset()
    step = env.step(torch.zeros(200, 1))
    error = step.final_observation - step.state["obs_buf"]
    assert 0.09 < float(error.abs().max()) <= 0.1 and abs(float(error.mean())) < 0.01


def test_a_push_changes_the_speed_of_the_whole_robot_by_what_was_drawn():
    # ANYmal starts in the air, with its feet 8 cm above the ground. In free fall nothing else acts sideways.
    env = made("anymal", ranges({"push": (0.5, 0.5), "push_every": (0.1, 0.1)}), worlds=40)
    env.reset()
    mass = torch.from_numpy(env.sim.model.body_mass).float()
    own = made("anymal", SAME, worlds=40)
    own.reset()
    speeds = []
    for one in (env, own):
        one.step(torch.zeros(40, 12))
        data = [one.sim.snapshot(i)[1] for i in range(40)]
        speeds.append(torch.stack([_momentum(one.sim.model, d) for d in data]) / float(mass.sum()))
    gained = (speeds[0] - speeds[1]).norm(dim=-1)
    pushed = gained > 0.01
    # A push every 0.1 s is a push in one of five steps of 0.02 s.
    assert 2 <= int(pushed.sum()) <= 16
    assert gained[pushed].tolist() == pytest.approx([0.5] * int(pushed.sum()), abs=0.02)
    assert float(env.sim.bind("xfrc_applied").abs().max()) == 0.0


def _momentum(model, data) -> torch.Tensor:
    mujoco.mj_subtreeVel(model, data)
    return torch.tensor(data.subtree_linvel[1, :2] * model.body_subtreemass[1])


@pytest.mark.parametrize("until", [1.0, 0.5])
def test_a_training_goes_on_in_the_worlds_it_left(monkeypatch: pytest.MonkeyPatch, until: float):
    """Resumed from a snapshot of all lanes (`until` = 1), or from the state of each paused lane."""
    monkeypatch.setattr(population, "PROGRESS_SECONDS", 0.0)
    budget = dataclasses.replace(SMALL, randomise=HARD)
    whole = trained(budget, "a", "b")
    specs = [LaneSpec(id=name, program="human") for name in ("a", "b")]
    if until < 1.0:
        half = trained(dataclasses.replace(budget, until=until), "a", "b")
        specs = [dataclasses.replace(spec, paused=half[spec.id].paused) for spec in specs]
        second = Population("cartpole", specs, budget, threads=1)
    else:
        first = Population("cartpole", specs, budget, threads=1)
        for message in first.train():
            if isinstance(message, TrainingProgress) and message.epoch == 2:
                break
        second = Population("cartpole", specs, budget, threads=1)
        second.resume(first.snapshot())
    results = [message for message in second.train() if isinstance(message, TrainingResult)]
    assert {r.lane: dataclasses.replace(r, seconds=0.0) for r in results} == whole


def test_a_lane_goes_on_alone_where_those_beside_it_acted_later(monkeypatch: pytest.MonkeyPatch):
    """A lane may resume alone because the others are finished or crash. Its snapshot still holds all of them."""
    monkeypatch.setattr(population, "PROGRESS_SECONDS", 0.0)
    near = ranges({"mass": (0.5, 2.0), "delay": (0.0, 0.02)})  # remembers two actions; the other lane, seven
    late = ranges({"delay": (0.0, 0.1), "noise": (0.0, 0.1)})
    specs = [
        LaneSpec(id="late", program="human", randomise=late),
        LaneSpec(id="near", program="human", randomise=near),
    ]
    first = Population("cartpole", specs, SMALL, threads=1)
    snapshot, results = b"", dict[str, TrainingResult]()
    for message in first.train():
        if isinstance(message, TrainingResult):
            results[message.lane] = message
        elif message.epoch == 2:
            snapshot = first.snapshot()
    alone = Population("cartpole", specs[1:], SMALL, threads=1)
    alone.resume(snapshot)
    (result,) = [message for message in alone.train() if isinstance(message, TrainingResult)]
    assert result.curves["reward"] == pytest.approx(results["near"].curves["reward"], rel=1e-4)


def test_where_worlds_are_reset_by_mask_they_are_drawn_the_same():
    pytest.importorskip("mujoco_warp", reason="pip install 'openeureka[gpu]'")
    envs = {
        device: registry.make("cartpole", worlds=4, device=device, threads=1, ranges=[HARD])
        for device in ("cpu", "warp-cpu")
    }
    for env in envs.values():
        env.reset()
    resets = 0
    for number in range(60):
        steps = [env.step(torch.full((4, 1), 1.0 if number % 20 < 10 else -1.0)) for env in envs.values()]
        resets += int(steps[0].done.sum())
        torch.testing.assert_close(envs["cpu"].worlds, envs["warp-cpu"].worlds)  # type: ignore[attr-defined]
        torch.testing.assert_close(steps[0].observation, steps[1].observation, atol=1e-3, rtol=1e-3)
    assert resets


def test_ranges_reach_a_worker():
    budget = dataclasses.replace(SMALL, randomise=HARD)
    assert unpack_lanes(pack_lanes("cartpole", [LaneSpec(id="a", program="human")], budget))[2] == budget


def test_every_lane_of_a_run_has_its_ranges_and_what_else_the_settings_say(tmp_path: Path):
    told = list[TrainBudget]()

    class Noting(ToyTrainer):
        def train(self, env, lanes, budget):
            told.append(budget)
            return super().train(env, lanes, budget)

    config = RunConfig(
        env="anymal", model="random", steps=5000, worlds=8, bonus="original", randomise="mild", observe="measurable"
    )
    mild = find("anymal", "mild")
    whole = TrainBudget(env_steps=5000, worlds=8, bonus="original", randomise=mild, observe="measurable")
    with Store.open(tmp_path / "run", config) as store:
        lanes = Lanes(config, store, Noting(), nobody)
        lanes.train([(Lane("human", 0, "baseline"), "human")])
        lanes.train([(Lane("human", 1, "final"), "human")], steps=900)
    assert mild is not None and told == [whole, dataclasses.replace(whole, env_steps=900)]


def test_a_name_takes_what_the_task_has():
    assert find("anymal", "none") is None
    cartpole, anymal = find("cartpole", "wide"), find("anymal", "wide")
    assert cartpole is not None and anymal is not None
    assert set(anymal.drawn) == set(NAMED["wide"]) and set(cartpole.drawn) == set(anymal.drawn) - {"friction", "push"}


def test_what_a_hand_holds_is_not_pushed():
    found = find("shadow_hand", "wide")
    assert found is not None and "push" not in found.drawn
    assert not made("shadow_hand", ranges({"push": (0.5, 0.5)}), worlds=1)._pushed  # from an older version


def test_what_flies_by_propellers_alone_is_pushed():
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="drone")
    body.add_freejoint()
    body.add_geom(size=[0.1, 0, 0])
    body.add_site(name="rotor")
    gear = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    spec.add_actuator(name="thrust", target="rotor", trntype=mujoco.mjtTrn.mjTRN_SITE, gear=gear)
    assert not useless(registry.get("quadcopter"), spec.compile(), "push")


def test_a_delay_that_rounds_to_no_step_is_not_drawn():
    assert find(PENDULUM, "mild") is not None and "delay" not in find(PENDULUM, "mild").drawn
    assert "delay" in find(PENDULUM, "wide").drawn and "delay" in find("cartpole", "mild").drawn


def test_a_file_gives_ranges_by_quantity(tmp_path: Path):
    (tmp_path / "r.yaml").write_text("mass: [0.8, 1.2]\nstiffness: [0.9, 1]\npush: 1\npush_every: 5\n")
    found = find("anymal", str(tmp_path / "r.yaml"))
    assert found is not None
    assert found.drawn == {"mass": (0.8, 1.2), "stiffness": (0.9, 1.0), "push": (1.0, 1.0), "push_every": (5.0, 5.0)}
    assert set(found.drawn) <= set(QUANTITIES)
    assert str(found).startswith("mass 0.8 to 1.2 factor, stiffness")


@pytest.mark.parametrize(
    ("env", "text", "sentence"),
    [
        ("anymal", "mess: [0.8, 1.2]", "has an unknown `mess`. Did you mean `mass`?"),
        (
            "anymal",
            "mass: [1.2, 0.8]",
            r"`mass: \[1.2, 0.8\]` in .* is no range; write the lowest and the highest factor",
        ),
        ("anymal", "mass: [0, 1]", "from 0.01 to 100, such as `mass: .0.8, 1.2.`"),
        ("anymal", "delay: [0, 40]", "is no range; write the lowest and the highest s, from 0 to 1"),
        ("anymal", "mass: heavy", "`mass: heavy` in .* is no range"),
        ("anymal", "mass: [.nan, 1]", "is no range"),
        ("anymal", "mass: [true, 1]", "is no range"),
        ("anymal", "mass: [1, 1" + "0" * 400 + "]", "is no range"),
        ("anymal", "- mass", "holds no ranges, such as"),
        ("anymal", "a: b: c", "are not YAML"),
        (
            PENDULUM,
            "delay: [0, 0.02]",
            "`delay` in .* changes nothing of `pendulum`, whose steps of 0.05 s are too long",
        ),
        ("cartpole", "push: [0, 1]", "`push` in .* changes nothing of `cartpole`, which has no floating base"),
        ("allegro_hand", "push_every: 5", "`push_every` in .* changes nothing of `allegro_hand`, which has no"),
        ("anymal", "push_every: 8", "`push_every` in .* changes nothing without a `push`; add one"),
        ("anymal", "push: 0\npush_every: 8", "`push_every` in .* changes nothing without a `push`; add one"),
        ("anymal", "mass: [1, 1]\nnoise: 0\npush: [0, 0]", "leaves `anymal` as it is; write ranges that differ"),
        ("cartpole", "stiffness: [0.9, 1.1]", "changes nothing of `cartpole`, whose model has nothing of the kind"),
    ],
)
def test_a_nonsense_range_is_one_sentence(tmp_path: Path, env: str, text: str, sentence: str):
    (tmp_path / "r.yaml").write_text(text)
    with pytest.raises(ConfigError, match=sentence):
        find(env, str(tmp_path / "r.yaml"))


def test_an_unknown_name_and_a_missing_file_are_one_sentence(tmp_path: Path):
    with pytest.raises(ConfigError, match="There are no ranges `wild`. Did you mean `wide`?"):
        find("anymal", "wild")
    with pytest.raises(ConfigError, match="Cannot read the ranges"):
        find("anymal", str(tmp_path / "none.yaml"))
