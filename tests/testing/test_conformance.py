"""The fakes and the built-in strategies pass the conformance suites."""

from openeureka.strategies import Best, Eureka
from openeureka.testing.conformance.model import ModelConformance
from openeureka.testing.conformance.search import SearchConformance
from openeureka.testing.conformance.trainer import TrainerConformance
from openeureka.testing.scripted import ScriptedModel, ToyTrainer


class TestScriptedModel(ModelConformance):
    def make(self) -> ScriptedModel:
        return ScriptedModel(["yes"] * 6)


class TestToyTrainer(TrainerConformance):
    env = "toy"

    def make(self) -> ToyTrainer:
        return ToyTrainer()


class TestEureka(SearchConformance):
    def make(self) -> Eureka:
        return Eureka(samples=4)


class TestBest(SearchConformance):
    def make(self) -> Best:
        return Best(samples=4)
