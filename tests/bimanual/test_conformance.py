import pytest

from openeureka.tasks.registry import get
from openeureka.testing.conformance.task import TaskConformance


class TwoHandsConformance(TaskConformance):
    random_worlds = 8  # few are enough: twenty tasks move the same two hands

    def test_the_hands_and_things_start_apart(self) -> None:
        worlds = 32 if self.random_start else 1
        simulation = self._make(worlds=worlds)
        simulation.reset()
        for world in range(worlds):
            model, data = simulation.sim.snapshot(world)
            for contact in data.contact[: data.ncon]:
                names = {model.body(int(model.geom_bodyid[geom])).name for geom in contact.geom}
                assert {name.split("_")[0] for name in names} != {"right", "left"}
                within_a_hand = all(name.startswith(("right_", "left_")) for name in names)
                assert within_a_hand or contact.dist >= -1e-3, f"{names} overlap by {-contact.dist:.4f} m"

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


class TestShadowHandBottleCap(TwoHandsConformance):
    env = "shadow_hand_bottle_cap"
    random_start = False


class TestShadowHandPushBlock(TwoHandsConformance):
    env = "shadow_hand_push_block"
    random_start = False


class TestShadowHandGraspAndPlace(TwoHandsConformance):
    env = "shadow_hand_grasp_and_place"
    random_start = False


class TestShadowHandBlockStack(TwoHandsConformance):
    env = "shadow_hand_block_stack"
    random_start = False


class TestShadowHandScissors(TwoHandsConformance):
    env = "shadow_hand_scissors"
    random_start = False


class TestShadowHandSwitch(TwoHandsConformance):
    env = "shadow_hand_switch"
    random_start = False


class TestShadowHandPen(TwoHandsConformance):
    env = "shadow_hand_pen"
    random_start = False


class TestShadowHandKettle(TwoHandsConformance):
    env = "shadow_hand_kettle"
    random_start = False


class TestShadowHandReOrientation(TwoHandsConformance):
    env = "shadow_hand_re_orientation"
    start_overlap = 0.02  # as with ShadowHandOver


class TestShadowHandCatchUnderarm(TwoHandsConformance):
    env = "shadow_hand_catch_underarm"
    start_overlap = 0.02  # as above


class TestShadowHandCatchOver2Underarm(TwoHandsConformance):
    env = "shadow_hand_catch_over2underarm"


class TestShadowHandCatchAbreast(TwoHandsConformance):
    env = "shadow_hand_catch_abreast"


class TestShadowHandTwoCatchUnderarm(TwoHandsConformance):
    env = "shadow_hand_two_catch_underarm"
    start_overlap = 0.02  # as above


class TestShadowHandLiftUnderarm(TwoHandsConformance):
    env = "shadow_hand_lift_underarm"
    random_start = False


class TestShadowHandDoorOpenInward(TwoHandsConformance):
    env = "shadow_hand_door_open_inward"
    random_start = False


class TestShadowHandDoorCloseInward(TwoHandsConformance):
    env = "shadow_hand_door_close_inward"
    random_start = False


class TestShadowHandDoorCloseOutward(TwoHandsConformance):
    env = "shadow_hand_door_close_outward"
    random_start = False
