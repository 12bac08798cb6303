"""The search in the guide `your-own-search.md` passes the conformance suite."""

import re
from pathlib import Path
from random import Random
from typing import Any

from openeureka.config import RunConfig
from openeureka.strategies import SearchStrategy
from openeureka.testing.conformance.search import SearchConformance, grown
from openeureka.types import Place, Remark, RemarkKind

GUIDE = Path(__file__).parents[2] / "docs" / "guides" / "your-own-search.md"


def tournament() -> SearchStrategy:
    written: dict[str, Any] = {}
    exec(re.findall(r"```python\n(.*?)```", GUIDE.read_text(), re.DOTALL)[0], written)
    return written["Tournament"](RunConfig(sample=4))


class TestTournament(SearchConformance):
    def make(self) -> SearchStrategy:
        return tournament()


def test_it_tells_the_model_what_a_person_said_and_improves_nothing_that_was_vetoed() -> None:
    search = tournament()
    veto = Remark(kind=RemarkKind.VETO, place=Place(0, 1))
    said = [Remark(kind=RemarkKind.WORDS, text="too jerky"), veto]
    plans = search.ask(grown([1.0, 2.0]).heard(said), Random(0))
    assert [plan.opinion.words for plan in plans] == [("too jerky",)] * 4
    assert {turn.fitness for plan in plans for turn in plan.turns} == {1.0}
