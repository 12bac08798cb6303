from openeureka.testing.conformance.task import TaskConformance


class TestShadowHandOver(TaskConformance):
    env = "shadow_hand_over"
    start_overlap = 0.02  # the original's random spread angles may press neighbouring fingers together


class TestShadowHandDoorOpenOutward(TaskConformance):
    env = "shadow_hand_door_open_outward"
    random_start = False


class TestShadowHandSwingCup(TaskConformance):
    env = "shadow_hand_swing_cup"
    random_start = False
