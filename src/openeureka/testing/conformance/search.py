"""What every search strategy must do. Inherit, make the strategy, and let pytest collect it:

class TestMySearch(SearchConformance):
    def make(self) -> SearchStrategy:
        return MySearch(samples=4)
"""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

from openeureka.strategies import SearchStrategy
from openeureka.types import (
    Candidate,
    History,
    Sample,
    Scored,
    TrainingResult,
    TrainingState,
    Verdict,
    VerdictCode,
)


def entries(generation: int, scores: Sequence[float | None], *, refused: bool = False) -> list[Scored]:
    """A generation with these F; None for a lane that diverged. With `refused`, no candidate was accepted."""
    made = []
    for slot, fitness in enumerate(scores):
        candidate = Candidate.of(f"{generation}/{slot}")
        code = VerdictCode.REFUSED if refused else VerdictCode.ACCEPTED
        verdict = Verdict(candidate=candidate.id, code=code)
        state = TrainingState.DIVERGED if fitness is None else TrainingState.FINISHED
        result = TrainingResult(
            lane=f"{candidate.id}-s0", state=state, fitness=fitness, curves={}, env_steps=0, seconds=0.0
        )
        sample = Sample(generation=generation, slot=slot, candidate=candidate, verdict=verdict)
        made.append(Scored(sample=sample, result=None if refused else result, feedback=f"F {fitness}"))
    return made


def grown(*generations: Sequence[float | None]) -> History:
    """Generations with these F."""
    history = History()
    for index, scores in enumerate(generations):
        history = history.grown(entries(index, scores))
    return history


SCORES = ([1.0, 3.0, None], [2.0, None, -1.0], [-4.0, 2.5])


class SearchConformance:
    """Checks that hold for any strategy; which rewards it makes parents is a matter for its own tests."""

    def make(self) -> SearchStrategy:
        raise NotImplementedError

    def test_the_first_prompts_follow_no_one(self) -> None:
        plans = self.make().ask(History(), Random(0))
        assert plans
        assert all(plan.count > 0 and not plan.turns and not plan.failures for plan in plans)

    def test_all_its_state_is_in_the_history(self) -> None:
        # A resumed run has a new strategy, the stored history and a generator of the same seed.
        old = self.make()
        for index in range(len(SCORES)):
            old.ask(grown(*SCORES[:index]), Random(f"0/{index}"))
        history = grown(*SCORES)
        assert list(self.make().ask(history, Random("0/3"))) == list(old.ask(history, Random("0/3")))

    def test_parents_are_entries_of_the_history_that_trained(self) -> None:
        history = grown(*SCORES)
        for plan in self.make().ask(history, Random(0)):
            assert plan.turns, "once rewards have trained, every plan must show one of them"
            assert all(turn in history.entries and turn.fitness is not None for turn in plan.turns)

    def test_when_nothing_trained_the_next_prompts_say_why(self) -> None:
        failed = entries(0, [0.0, 0.0], refused=True)
        for plan in self.make().ask(History().grown(failed), Random(0)):
            assert plan.count > 0 and not plan.turns
            assert set(plan.failures) <= set(failed) and plan.failures

    def test_it_judges_by_policies_that_lanes_have(self) -> None:
        strategy = self.make()
        assert strategy.ranks in ("played", "training")
        assert strategy.peaks and set(strategy.peaks) <= {"fitness", "reward", "last"}
