import pytest

from openeureka.executors.local import LocalExecutor
from openeureka.testing.conformance.trainer import TrainerConformance
from openeureka.types import TrainBudget


@pytest.mark.usefixtures("lasting")
class TestLocalExecutor(TrainerConformance):
    env = "cartpole"
    budget = TrainBudget(env_steps=2048, worlds=16)

    def make(self) -> LocalExecutor:
        return LocalExecutor(threads=1)
