from openeureka.testing.conformance.task import TaskConformance


class SuiteConformance(TaskConformance):
    random_worlds = 64  # as many as usual would take as long as all other checks of a hand or a humanoid


class TestCartpole(SuiteConformance):
    env = "cartpole"


class TestBallBalance(SuiteConformance):
    env = "ballbalance"


class TestQuadcopter(SuiteConformance):
    env = "quadcopter"


class TestAnt(SuiteConformance):
    env = "ant"


class TestHumanoid(SuiteConformance):
    env = "humanoid"
    start_overlap = 0.1  # the original's random hip angles may cross the legs


class TestFrankaCabinet(SuiteConformance):
    env = "franka_cabinet"


class TestAnymal(SuiteConformance):
    env = "anymal"


class TestAllegroHand(SuiteConformance):
    env = "allegro_hand"


class TestShadowHand(SuiteConformance):
    env = "shadow_hand"
    start_overlap = 0.01  # the original's random spread angles may press neighbouring fingers together


class TestShadowHandSpin(SuiteConformance):
    env = "shadow_hand_spin"
    start_overlap = 0.01  # the fingers, as for ShadowHand
    random_worlds = 16  # few, as ShadowHand tests the same hand


class TestShadowHandUpsideDown(SuiteConformance):
    env = "shadow_hand_upside_down"
    start_overlap = 0.01  # the fingers, as for ShadowHand
    random_worlds = 16  # few, as ShadowHand tests the same hand
