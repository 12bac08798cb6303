"""What a policy costs while it plays."""

from __future__ import annotations

import pytest
import torch

from openeureka.errors import ConfigError
from openeureka.tasks import costs, registry
from openeureka.tasks.costs import Meter
from openeureka.tasks.env import BatchedEnv

LEGGED = (
    *("torque", "torque_peak", "torque_rate", "joint_limits", "speed", "power"),
    *("contact_force", "falls"),
)


@pytest.mark.parametrize(
    ("env", "names"),
    [
        ("anymal", LEGGED),
        ("cartpole", LEGGED[:6]),  # it neither touches anything nor falls
        ("quadcopter", (*LEGGED[:6], "falls")),
        ("ballbalance", (*LEGGED[:6], "falls")),  # its feet are held by pins, not by contacts
    ],
)
def test_a_task_has_the_costs_that_its_model_gives(env: str, names: tuple[str, ...]) -> None:
    task = registry.get(env)
    assert costs.measured(task, task.compile_model()) == names


def test_an_episode_that_a_success_may_end_is_no_fall() -> None:
    class Arriving(registry.get("anymal")):
        counts_early = False

    assert "falls" not in costs.measured(Arriving, Arriving.compile_model())
    assert Meter(BatchedEnv(Arriving, worlds=1, threads=1)).names == LEGGED[:-1]


def test_numbers_are_those_of_the_simulation() -> None:
    """Two lanes of two worlds. The third world's episode is over before the second step."""
    env = registry.make("anymal", worlds=2, lane_seeds=[0, 0], threads=1)
    meter = Meter(env)
    env.reset()
    running = torch.ones(4, dtype=torch.bool)
    force, pressed = env.sim.bind("qfrc_actuator"), env.sim.bind("qfrc_constraint")
    torques, contacts = [], []
    for index in range(3):
        step = env.step(torch.full((4, 12), 0.5 if index else -0.5))
        meter.add(step, running)
        assert not step.done.any()  # a reset would overwrite the fields that were measured
        torques.append(force[:, 6:].clone())
        contacts.append(pressed[:, :3].norm(dim=1).clone())
        running[2] = False
    first, second = meter.read(2)
    assert tuple(first) == LEGGED
    every = torch.stack(torques).abs().amax(2)
    rates = torch.stack(torques).diff(dim=0).abs().amax(2) / 0.02
    assert first["torque"] == pytest.approx(float(every[:, :2].mean()), rel=1e-5)
    assert second["torque"] == pytest.approx(float((every[0, 2] + every[:, 3].sum()) / 4), rel=1e-5)
    assert first["torque_peak"] == pytest.approx(float(every[:, :2].amax(0).mean()), rel=1e-5)
    assert first["torque_rate"] == pytest.approx(float(rates[:, :2].sum() / 6), rel=1e-5)
    assert first["contact_force"] == pytest.approx(
        float(torch.stack(contacts)[:, :2].amax(0).mean()), rel=1e-4, abs=1e-4
    )
    assert first["falls"] == 0.0 and 0.0 <= first["joint_limits"] <= 1.0 and first["power"] > 0.0


def test_numbers_are_those_of_the_joints_and_of_how_an_episode_ends() -> None:
    """One step of two worlds: the first falls, the second times out."""
    env = registry.make("anymal", worlds=2, lane_seeds=[0], threads=1)
    meter = Meter(env)
    env.reset()
    step = env.step(torch.zeros(2, 12))
    force, rate, at = (env.sim.bind(name) for name in ("qfrc_actuator", "qvel", "qpos"))
    force[:, 6:], rate[:, 6:] = 0.0, 0.0
    force[0, 6:9], rate[0, 6:9] = torch.tensor([3.0, -4.0, 0.0]), torch.tensor([2.0, 1.0, -5.0])
    low, high = torch.tensor(env.sim.model.jnt_range[1:], dtype=torch.float32).T
    at[:, 7:] = (low + high) / 2
    at[0, 7] = low[0] + 0.02 * (high - low)[0]  # more than a hundredth of its range from the limit
    at[1, 9] = high[2] - 0.005 * (high - low)[2]
    assert env.watch is not None
    env.watch()
    fell, late = torch.tensor([True, False]), torch.tensor([False, True])
    meter.add(step._replace(terminated=fell, timed_out=late), torch.ones(2, dtype=torch.bool))
    (found,) = meter.read(1)
    # The first world has 4, 5, and 3 * 2 + 4 * 1 = 10; the second has 0.
    assert (found["torque"], found["speed"], found["power"]) == pytest.approx((2.0, 2.5, 5.0))
    assert (found["joint_limits"], found["falls"]) == (0.5, 0.5)


def test_an_unknown_limit_says_what_the_task_has() -> None:
    with pytest.raises(ConfigError, match=r"no cost `torqe` to limit. Did you mean `torque`\? It has torque \[N m\], "):
        costs.check("cartpole", {"torqe": 40.0})
    with pytest.raises(ConfigError, match="`cartpole` has no cost `falls`"):
        costs.check("cartpole", {"falls": 0.1})
    costs.check("anymal", {"falls": 0.1})


def test_a_body_that_drives_no_joint_and_touches_nothing_can_fall(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stands for a drone whose thrust acts at sites: it has no driven joints and no contacts."""
    monkeypatch.setattr(costs, "_driven", lambda model: [])
    env = registry.make("quadcopter", worlds=2, lane_seeds=[0], threads=1)
    meter = Meter(env)
    assert meter.names == ("falls",)
    env.reset()
    meter.add(env.step(torch.zeros(2, env.task.num_actions)), torch.ones(2, dtype=torch.bool))
    assert meter.read(1) == [{"falls": 0.0}]
