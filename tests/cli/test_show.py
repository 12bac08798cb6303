"""How tables and sentences are printed."""

import sys

import pytest

from openeureka.cli.show import tell
from openeureka.numbers import columns

TABLE = columns([("ranges", "what worlds are drawn from"), ("mass 0.5 to 2, " * 8, "none")])
VERDICT = (
    "Not decided: F 136.7 (3 seeds) against 111.8 (4 seeds), held out; difference +25, 95 % interval -80.8 to +131. "
    "If the difference is real, 28 new seeds of each have an even chance to show it."
)


def test_a_terminal_breaks_sentences_between_words_and_no_row_of_a_table(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    tell([TABLE, "", VERDICT])
    lines = capsys.readouterr().out.splitlines()
    assert lines[:3] == [*TABLE.splitlines(), ""]
    assert max(map(len, lines[3:])) <= 80 and " ".join(lines[3:]) == VERDICT


def test_a_file_gets_each_sentence_as_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setenv("COLUMNS", "80")
    tell([TABLE, "", VERDICT])
    assert capsys.readouterr().out == f"{TABLE}\n\n{VERDICT}\n"
