import mujoco
import pytest
import torch

from openeureka.sim import CpuSimulator
from openeureka.sim.perturb import perturb
from openeureka.types import Dynamics

SLED = """
<mujoco>
  <option timestep="0.01"/>
  <worldbody>
    <geom name="floor" type="plane" size="9 9 1" friction="0.5 0.005 0.0001"/>
    <body pos="0 0 0.1"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="2" friction="0.5 0.005 0.0001"/></body>
  </worldbody>
</mujoco>
"""


def test_mass_and_inertia_are_scaled_for_the_lanes_that_ask_for_it():
    sim = CpuSimulator(mujoco.MjModel.from_xml_string(SLED), 4, threads=1)
    perturb(sim, [Dynamics(), Dynamics(mass=1.1)])
    sim.forward(torch.arange(4))
    assert sim.expand("body_mass")[:, 1].tolist() == pytest.approx([2.0, 2.0, 2.2, 2.2])
    model, _ = sim.snapshot(3)
    # A cube of side 0.2 m: inertia m a^2 / 6.
    assert model.body_inertia[1] == pytest.approx([2.2 * 0.04 / 6] * 3)


def test_a_body_on_slippery_ground_slides_further():
    sim = CpuSimulator(mujoco.MjModel.from_xml_string(SLED), 2, threads=1)
    qpos, qvel = sim.bind("qpos"), sim.bind("qvel")
    perturb(sim, [Dynamics(friction=1.1), Dynamics(friction=0.9)])
    qvel[:, 0] = 2.0
    sim.forward(torch.arange(2))
    for _ in range(200):
        sim.step(1)
    # Braked by mu g it slides v^2 / (2 mu g): 0.37 m with mu = 0.55, 0.45 m with 0.45.
    assert qpos[:, 0].tolist() == pytest.approx([0.37, 0.45], abs=0.03)
    assert float(qpos[1, 0] - qpos[0, 0]) > 0.05


def test_worlds_that_nobody_changes_share_their_model(monkeypatch: pytest.MonkeyPatch):
    sim = CpuSimulator(mujoco.MjModel.from_xml_string(SLED), 2, threads=1)
    asked: list[str] = []
    monkeypatch.setattr(sim, "expand", asked.append)
    perturb(sim, [Dynamics(), Dynamics()])
    assert asked == []
