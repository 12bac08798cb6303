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
