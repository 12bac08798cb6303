import pytest

from openeureka.tasks.registry import get
from openeureka.testing.conformance.task import TaskConformance


class TwoHandsConformance(TaskConformance):
    random_worlds = 128

    def test_the_hands_start_apart(self) -> None:
        simulation = self._make(worlds=8)
        simulation.reset()
        for world in range(8):
            model, data = simulation.sim.snapshot(world)
            for contact in data.contact[: data.ncon]:
                sides = {model.body(int(model.geom_bodyid[geom])).name.split("_")[0] for geom in contact.geom}
                assert sides != {"right", "left"}

    def test_mujoco_warp_takes_the_model(self) -> None:
        mujoco_warp = pytest.importorskip("mujoco_warp")
        mujoco_warp.put_model(get(self.env).compile_model())


class TestShadowHandOver(TwoHandsConformance):
    env = "shadow_hand_over"
    start_overlap = 0.02  # the original's random spread angles may press neighbouring fingers together


class TestShadowHandDoorOpenOutward(TwoHandsConformance):
    env = "shadow_hand_door_open_outward"
    random_start = False


class TestShadowHandSwingCup(TwoHandsConformance):
    env = "shadow_hand_swing_cup"
    random_start = False
