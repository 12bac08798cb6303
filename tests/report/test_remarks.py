"""What a person said is shown, and inert, in every format."""

from pathlib import Path

import pytest
from loop.alone import run

from openeureka import strategies
from openeureka.cli.facts import facts
from openeureka.cli.show import show
from openeureka.config import RunConfig
from openeureka.events import nobody
from openeureka.report import html
from openeureka.report.view import RunView
from openeureka.store import Store, say
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyTrainer, reply
from openeureka.types import Place, Remark, RemarkKind

HOSTILE = "</pre><script>alert(1)</script>\x1b[31mred\u202egpj.exe"
CONFIG = RunConfig(sample=2, iteration=2, repair=0, refill=0, seeds=1, feedback="human", judge="votes")


class Person:
    def __init__(self, directory: Path, words: str) -> None:
        self.directory, self.words = directory, words

    def invite(self, generation) -> None: ...

    def listen(self, seconds: float) -> None:
        a, b = Place(0, 0), Place(0, 1)
        say(
            self.directory,
            Remark(kind=RemarkKind.WORDS, text=self.words),
            Remark(kind=RemarkKind.VOTE, place=a, over=b),
            Remark(kind=RemarkKind.VETO, place=b),
            Remark(kind=RemarkKind.GO),
        )


@pytest.fixture
def finished(tmp_path: Path):
    def finished(words: str) -> Path:
        directory = tmp_path / "run"
        model = ScriptedModel([reply(7), reply(8), reply(1), reply(2)])
        with Store.open(directory, CONFIG) as store:
            desk = Person(directory, words)
            run(CONFIG, store, model, ToyChecker(), ToyTrainer(), TOY, strategies.make(CONFIG), nobody, desk)
        return directory

    return finished


def test_remarks_strengths_and_vetoes_are_in_every_report(finished, capsys) -> None:
    directory = finished("too jerky")
    view = RunView.read(directory)
    assert [c.vetoed for c in view.candidates] == [False, True, False, False]
    preferred, other = view.generations[0].candidates
    assert preferred.strength is not None and other.strength is not None and preferred.strength > other.strength
    show(directory)
    for text in (html.report(view, directory), capsys.readouterr().out):
        assert "too jerky" in text
        assert "g0s0 is better than g0s1" in text and "veto: g0s1" in text
    assert "strength by votes" in html.report(view, directory)


def test_what_nobody_has_heard_yet_is_shown_too(finished, capsys) -> None:
    directory = finished("too jerky")
    with Store.open(directory, CONFIG) as store:
        store.remarks.say(Remark(kind=RemarkKind.WORDS, text="later"))
    view = RunView.read(directory)
    text = html.report(view, directory)
    assert "Feedback since then" in text and "later" in text
    show(directory)
    assert "Since the last prompt:\n  later\n" in capsys.readouterr().out
    assert facts(view)["unheard"] == [{"kind": "words", "text": "later", "candidate": None, "over": None}]


def test_hostile_words_are_text_and_a_megabyte_is_cut(finished, capsys) -> None:
    directory = finished(HOSTILE + "x" * 1_000_000)
    view = RunView.read(directory)
    page = html.report(view, directory)
    assert "<script>alert" not in page and "&lt;script&gt;alert" in page
    show(directory)
    for text in (page, capsys.readouterr().out):
        assert "\x1b" not in text and "\u202e" not in text
        assert len(text) < 350_000
