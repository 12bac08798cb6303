import io
import os
from dataclasses import replace
from pathlib import Path

import pytest
from report.scripted import search_in

from openeureka.cli import terminal
from openeureka.cli.remote import feedback
from openeureka.cli.terminal import TerminalDesk
from openeureka.config import RunConfig
from openeureka.errors import FeedbackError
from openeureka.events import Began, Event
from openeureka.store import Store, read_config
from openeureka.store.remarks import remark, spoken, typed
from openeureka.testing.conformance.search import entries
from openeureka.testing.scripted import reply
from openeureka.types import Generation, Place, Remark, RemarkKind

CONFIG = RunConfig(sample=2, iteration=2, feedback="human", feedback_timeout=90)
GO = Remark(kind=RemarkKind.GO)
JERKY = Remark(kind=RemarkKind.WORDS, text="too jerky")


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    Store.open(tmp_path / "run", CONFIG).close()
    return tmp_path / "run"


@pytest.fixture
def waiting(tmp_path: Path) -> Path:
    """A run that was killed while it waited for a person's remarks on g0s0 and g0s1."""

    def killed(event: Event) -> None:
        if isinstance(event, Began) and event.phase == "feedback":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search_in(tmp_path / "waiting", [reply(7), reply(8)], tell=killed, iteration=2, feedback="human")
    return tmp_path / "waiting"


def said(directory: Path) -> tuple[Remark, ...]:
    with Store.view(directory) as store:
        return store.remarks.unheard()


def test_marks_are_told_from_words() -> None:
    assert remark("go") == GO
    assert remark("go slower") == Remark(kind=RemarkKind.WORDS, text="go slower")
    assert remark("favourite=g0s3") == remark("favorite=g0s3") == Remark(kind=RemarkKind.FAVOURITE, place=Place(0, 3))
    assert remark("veto=g12s0") == Remark(kind=RemarkKind.VETO, place=Place(12, 0))
    wanted = Remark(kind=RemarkKind.VOTE, place=Place(0, 3), over=Place(0, 1))
    assert remark("vote=g0s3:g0s1") == remark("vote=g0s3>g0s1") == wanted


@pytest.mark.parametrize("word", ["favourite=3", "veto=", "vote=g0s3:x", "veto=g0s1:g0s2"])
def test_a_mark_that_names_no_candidate_is_explained(word: str) -> None:
    with pytest.raises(FeedbackError, match=f"^`{word}` names no candidate; write g0s3 for slot 3 of generation 0"):
        remark(word)


@pytest.mark.parametrize("word", ["vote=", "vote=g0s3", "vote=g0s3:", "vote=:g0s3"])
def test_a_vote_for_one_is_told_that_it_needs_two(word: str) -> None:
    with pytest.raises(FeedbackError, match=f"^`{word}` does not name two candidates. .* first: vote=g0s3:g0s1.$"):
        remark(word)


@pytest.mark.parametrize(
    "word", ["favourit=g1s1", "Favourite=g1s1", "vetoe=g1s1", "gain=2", "best=", "favorit=g0s1 go"]
)
def test_what_looks_like_a_mark_and_is_none_does_not_become_words_for_the_model(word: str) -> None:
    with pytest.raises(FeedbackError, match=r"^There is no mark `\w+=`\."):
        remark(word)


@pytest.mark.parametrize("words", ["gain=2 is too much", "it leans: angle = 0.3", "x=1, then stop", "= better"])
def test_words_may_hold_an_equals_sign(words: str) -> None:
    assert remark(words) == Remark(kind=RemarkKind.WORDS, text=words)


def test_a_typed_line_is_words_or_marks_and_an_empty_one_goes_on() -> None:
    assert typed("\n") == typed("go\n") == [GO]
    assert typed("too jerky\n") == [JERKY]
    assert typed("veto=g0s1 favourite=g0s0") == [remark("veto=g0s1"), remark("favourite=g0s0")]


def test_a_typed_line_may_be_what_another_shell_is_told() -> None:
    favourite = remark("favourite=g0s3")
    assert typed('"too jerky" favourite=g0s3 go\n') == [favourite, JERKY, GO]
    assert typed("too jerky favourite=g0s3") == [favourite, JERKY]
    assert typed("go favourite=g0s3") == typed("favourite=g0s3 go") == [favourite, GO]
    assert typed("'it doesn't stop' \"or turn\"") == [remark("it doesn't stop"), remark("or turn")]


def test_loose_words_are_one_sentence_and_each_quoted_one_is_its_own_at_either_door() -> None:
    loose = [remark("veto=g0s1"), remark("too jerky, keep")]
    assert spoken(["too", "jerky,", "keep", "veto=g0s1"]) == typed("too jerky, keep veto=g0s1") == loose
    mixed = [remark("it leans"), remark("set gain=2"), remark("stop earlier"), GO]
    assert spoken(["stop", "it leans", "earlier", "set gain=2", "go"]) == mixed
    assert typed('stop "it leans" earlier "set gain=2" go') == mixed


@pytest.mark.parametrize("go", ["go", "GO", "Go"])
def test_go_counts_in_either_case(go: str) -> None:
    assert spoken([go]) == typed(go) == [GO]
    assert typed(f"too jerky {go}") == [JERKY, GO]


def test_a_misspelt_mark_among_words_is_named_and_a_setting_is_not() -> None:
    with pytest.raises(FeedbackError, match="There is no mark `favourit=`. Did you mean `favourite`?"):
        typed("too jerky favourit=g0s1")
    assert typed("it should set gain=2") == [remark("it should set gain=2")]


def test_go_in_a_sentence_does_not_end_the_wait() -> None:
    assert typed("veto=g0s1 it must not go so fast") == [remark("veto=g0s1"), remark("it must not go so fast")]
    assert typed('"let it go"') == [remark("let it go")]
    assert typed("let it go veto=g0s1") == [remark("veto=g0s1"), remark("let it go")]


def test_the_command_keeps_what_is_said_and_says_when_the_run_goes_on(waiting: Path, capsys) -> None:
    with Store.open(waiting, read_config(waiting)):
        feedback(waiting, ["too jerky"])
        assert "when you say `go`" in capsys.readouterr().out
        feedback(waiting, ["go"])
        assert capsys.readouterr().out == "The run continues.\n"
        feedback(waiting, ["it", "leans", "back"])
    assert said(waiting) == (JERKY, GO, remark("it leans back"))


@pytest.mark.parametrize("words", [["too jerky"], ["too jerky", "go"]])
def test_the_command_says_how_a_run_goes_on_that_nobody_works_on(waiting: Path, capsys, words: list[str]) -> None:
    feedback(waiting, words)
    told = f"Saved. The run has stopped; continue it with: eureka resume {waiting}\n"
    assert capsys.readouterr().out == told and said(waiting)[0] == JERKY


def test_go_before_there_is_something_to_judge_is_refused_and_nothing_kept(directory: Path) -> None:
    with pytest.raises(FeedbackError, match="^The run in .* has no new policies to judge yet, so nothing was saved; "):
        feedback(directory, ["too jerky", "go"])
    assert said(directory) == ()
    feedback(directory, ["too jerky"])
    assert said(directory) == (JERKY,)


def test_nothing_said_is_refused_with_an_example(directory: Path) -> None:
    for words in ([], [" "]):
        with pytest.raises(FeedbackError, match="Say something"):
            feedback(directory, words)


class Keyboard(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_the_terminal_shows_each_candidate_and_keeps_lines_typed(waiting: Path, monkeypatch, capsys) -> None:
    monkeypatch.setattr("sys.stdin", Keyboard("too jerky\nveto=g9s9\n\n"))
    monkeypatch.setattr(terminal.select, "select", lambda *_: ([], [], []))
    desk = TerminalDesk(waiting, CONFIG, [])
    desk.invite(Generation(0, tuple(entries(0, [1.0, 2.0]))))
    shown = capsys.readouterr().out
    assert "g0s0       1" in shown and "g0s1       2" in shown
    assert f"eureka feedback {waiting}" in shown
    assert "Without `go` the run continues after 1 min 30 s." in shown
    monkeypatch.setattr(terminal.select, "select", lambda *lists: (lists[0], [], []))
    desk.listen(0)
    desk.listen(0)
    assert "g9s9 is not a trained candidate" in capsys.readouterr().out
    desk.listen(0)
    assert said(waiting) == (JERKY, GO)
    desk.listen(0)  # the end of the input: from now on only other shells are heard
    assert said(waiting) == (JERKY, GO)


def test_of_what_was_typed_before_there_was_anything_to_watch_the_words_count_and_go_does_not(
    waiting: Path, monkeypatch
) -> None:
    keyboard = Keyboard("\ntoo jerky go\n\n")
    monkeypatch.setattr("sys.stdin", keyboard)
    monkeypatch.setattr(terminal.select, "select", lambda *lists: (lists[0] if keyboard.tell() < 15 else [], [], []))
    desk = TerminalDesk(waiting, CONFIG, [])
    desk.invite(Generation(0, ()))
    desk.listen(0)
    assert said(waiting) == (JERKY,)


def test_a_byte_that_the_locale_cannot_read_ends_no_run(directory: Path, monkeypatch) -> None:
    class Odd(io.TextIOWrapper):
        def isatty(self) -> bool:
            return True

    monkeypatch.setattr("sys.stdin", Odd(io.BytesIO(b"too \xe9 jerky\n"), encoding="utf-8", errors="strict"))
    monkeypatch.setattr(terminal.select, "select", lambda *lists: (lists[0], [], []))
    TerminalDesk(directory, CONFIG, []).listen(0)
    assert said(directory) == (remark("too \ufffd jerky"),)


def test_a_job_in_the_background_leaves_the_keyboard_alone(directory: Path, monkeypatch) -> None:
    """A shell stops a background job that reads from the terminal."""

    class Terminal(Keyboard):
        def fileno(self) -> int:
            return 0

    monkeypatch.setattr("sys.stdin", Terminal("too jerky\n"))
    monkeypatch.setattr(terminal.select, "select", lambda *lists: (lists[0], [], []))
    desk = TerminalDesk(directory, CONFIG, [])
    for group, heard in ((os.getpgrp() + 1, ()), (os.getpgrp(), (JERKY,))):
        monkeypatch.setattr(terminal.os, "tcgetpgrp", lambda _, group=group: group)
        desk.listen(0)
        assert said(directory) == heard


def test_where_standard_input_is_closed_other_shells_are_heard(directory: Path, monkeypatch) -> None:
    monkeypatch.setattr("sys.stdin", None)
    desk = TerminalDesk(directory, CONFIG, [])
    desk.listen(0)
    feedback(directory, ["too", "jerky"])
    desk.listen(0)
    assert said(directory) == (JERKY,)


def test_without_films_nothing_is_to_be_watched(directory: Path, capsys) -> None:
    TerminalDesk(directory, replace(CONFIG, video="none"), []).invite(Generation(0, tuple(entries(0, [1.0, 2.0]))))
    shown = capsys.readouterr().out
    assert "Generation 0 is trained. With video=none, no policies are filmed:\ncandidate  F\ng0s0       1\n" in shown


def test_the_command_for_another_shell_can_be_typed_as_it_stands(directory: Path, tmp_path: Path, capsys) -> None:
    spaced = directory.rename(tmp_path / "my run")
    TerminalDesk(spaced, CONFIG, []).invite(Generation(0, ()))
    assert f"eureka feedback '{spaced}' " in capsys.readouterr().out


def test_without_a_terminal_nothing_is_read(directory: Path, monkeypatch, capsys) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("not for me\n"))
    desk = TerminalDesk(directory, CONFIG, [])
    desk.invite(Generation(0, ()))
    assert "or here" not in capsys.readouterr().out
    desk.listen(0)
    assert said(directory) == ()
