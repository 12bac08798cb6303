from openeureka.testing.conformance.task import TaskConformance


class TestCartpole(TaskConformance):
    env = "cartpole"


class TestBallBalance(TaskConformance):
    env = "ballbalance"


class TestQuadcopter(TaskConformance):
    env = "quadcopter"
