from openeureka.executors.local import PopulationTrainer
from openeureka.testing.conformance.trainer import TrainerConformance
from openeureka.types import TrainBudget


class TestPopulationTrainer(TrainerConformance):
    env = "cartpole"
    budget = TrainBudget(env_steps=4096, worlds=16)

    def make(self) -> PopulationTrainer:
        return PopulationTrainer(threads=1)
