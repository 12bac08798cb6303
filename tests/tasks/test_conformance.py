from openeureka.testing.conformance.task import TaskConformance


class TestCartpole(TaskConformance):
    env = "cartpole"


class TestBallBalance(TaskConformance):
    env = "ballbalance"


class TestQuadcopter(TaskConformance):
    env = "quadcopter"


class TestAnt(TaskConformance):
    env = "ant"


class TestHumanoid(TaskConformance):
    env = "humanoid"
    start_overlap = 0.1  # the original's random hip angles may cross the legs


class TestFrankaCabinet(TaskConformance):
    env = "franka_cabinet"


class TestAnymal(TaskConformance):
    env = "anymal"


class TestAllegroHand(TaskConformance):
    env = "allegro_hand"


class TestShadowHand(TaskConformance):
    env = "shadow_hand"
    start_overlap = 0.01  # the original's random spread angles may press neighbouring fingers together


class TestShadowHandSpin(TaskConformance):
    env = "shadow_hand_spin"
    start_overlap = 0.01  # the fingers, as for ShadowHand
    random_worlds = 32  # few, as ShadowHand tests the same hand


class TestShadowHandUpsideDown(TaskConformance):
    env = "shadow_hand_upside_down"
    start_overlap = 0.01  # the fingers, as for ShadowHand
    random_worlds = 32  # few, as ShadowHand tests the same hand
