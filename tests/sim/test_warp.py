"""MuJoCo Warp on its CPU device; kernels are compiled in the first run and kept in warp's cache (WARP_CACHE_PATH)."""

import mujoco
import pytest
import torch

from openeureka.errors import TaskError
from openeureka.sim import Simulator, open_simulator
from openeureka.sim.base import Capacity
from openeureka.tasks.registry import get, make
from openeureka.testing.conformance.simulator import SimulatorConformance

pytest.importorskip("mujoco_warp", reason="pip install 'openeureka[gpu]'")
pytestmark = pytest.mark.timeout(900)  # a minute of compilation on a quiet machine


class TestWarpSimulator(SimulatorConformance):
    def open(self, model: mujoco.MjModel, worlds: int) -> Simulator:
        return open_simulator(model, worlds, device="warp-cpu", room=Capacity(contacts=4, constraints=8))


def test_a_lack_of_room_is_an_error_that_names_the_setting(monkeypatch: pytest.MonkeyPatch):
    ballbalance = get("ballbalance")
    monkeypatch.setattr(ballbalance, "max_constraints", 4)  # the pins of its feet are nine rows
    simulation = make("ballbalance", worlds=2, device="warp-cpu")
    simulation.reset()
    simulation.step(torch.zeros(2, 3))
    with pytest.raises(TaskError, match="4 constraints a world.*raise `max_constraints`"):
        simulation.check()
