"""MuJoCo Warp on its CPU device. The first run compiles kernels and keeps them in warp's cache (WARP_CACHE_PATH)."""

import mujoco
import pytest
import torch

from openeureka.errors import TaskError
from openeureka.sim import Simulator, open_simulator
from openeureka.sim.base import Capacity
from openeureka.tasks.registry import get, make
from openeureka.testing.conformance.simulator import SimulatorConformance

pytest.importorskip("mujoco_warp", reason="pip install 'openeureka[gpu]'")


class TestWarpSimulator(SimulatorConformance):
    def open(self, model: mujoco.MjModel, worlds: int) -> Simulator:
        return open_simulator(model, worlds, device="warp-cpu", room=Capacity(contacts=4, constraints=8))


PRESSED = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="9 9 1"/>
    <body pos="0 0 0.1">
      <freejoint/><geom size="0.1" mass="2"/><site name="middle"/>
    </body>
  </worldbody>
  <sensor><accelerometer site="middle"/></sensor>
</mujoco>
"""


@pytest.fixture
def pressed(monkeypatch: pytest.MonkeyPatch) -> tuple[Simulator, list[int]]:
    """Three worlds with a ball on a floor, and a list to which each call of `set_const` adds its number of worlds."""
    from openeureka.sim import warp

    derive, calls = warp.mjw.set_const, list[int]()
    monkeypatch.setattr(warp.mjw, "set_const", lambda model, data: (calls.append(data.nworld), derive(model, data)))
    return open_simulator(mujoco.MjModel.from_xml_string(PRESSED), 3, device="warp-cpu"), calls


def test_constants_are_derived_anew_from_a_mass_and_not_from_a_friction(pressed: tuple[Simulator, list[int]]):
    sim, calls = pressed
    worlds, mass, friction = torch.tensor([1]), sim.expand("body_mass"), sim.expand("geom_friction")
    sim.bind("qvel")[:, 0] = 1.0
    sim.forward(torch.arange(3))
    friction[1] *= 0.1
    sim.forward(worlds)
    assert not calls
    for _ in range(5):
        sim.step(2)
    assert sim.bind("qvel")[1, 0] > sim.bind("qvel")[0, 0] + 1e-3  # its friction is lower
    mass[1] *= 2.0
    sim.forward(worlds)
    sim.step(1)
    assert calls == [3]


def test_sensors_of_other_worlds_keep_what_they_felt_where_models_change(pressed: tuple[Simulator, list[int]]):
    sim, _ = pressed
    felt, friction = sim.bind("sensordata"), sim.expand("geom_friction")
    sim.step(20)
    before = felt.clone()
    assert before[:, 2].tolist() == pytest.approx([9.81] * 3, abs=1.0)
    friction[1] *= 0.1
    sim.forward(torch.tensor([1]))
    assert torch.equal(felt[[0, 2]], before[[0, 2]])


def test_a_lack_of_room_is_an_error_that_names_the_setting(monkeypatch: pytest.MonkeyPatch):
    ballbalance = get("ballbalance")
    monkeypatch.setattr(ballbalance, "max_constraints", 4)  # the three pinned feet alone take nine rows
    simulation = make("ballbalance", worlds=2, device="warp-cpu")
    simulation.reset()
    simulation.step(torch.zeros(2, 3))
    with pytest.raises(TaskError, match="4 constraints per world.*raise `max_constraints`"):
        simulation.check()
