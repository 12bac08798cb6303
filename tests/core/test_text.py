"""Text from elsewhere, made safe to show and to keep."""

import sqlite3

import pytest

from openeureka.text import MAX_TEXT, one_line, plain, printable, safe_text, visible


@pytest.mark.parametrize(
    ("text", "safe"),
    [
        ("\x1b[31mred\x1b[0m", "red"),
        ("\x1b]0;window title\x07after", "after"),
        ("\x1b]8;;http://x\x1b\\link", "link"),
        ("a\x9b31mb", "a31mb"),  # the one-byte form of ESC [
        ("low\x1b\nterm", "low\nterm"),  # no sequence continues past the end of a line
        ("abc\rdef\x08\x00", "abcdef"),
        ("user\u202egpj.exe", "usergpj.exe"),
        ("zero\u200bwidth", "zerowidth"),
        ("kept\n\ttoo: é λ 你", "kept\n\ttoo: é λ 你"),
    ],
)
def test_terminal_controls_and_invisible_marks_are_removed(text, safe):
    assert plain(text) == safe


def test_one_line_is_cut_to_its_width():
    assert one_line("a\n b\tc") == "a b c"
    assert one_line("abcdef", width=4) == "abc…"


def test_a_message_is_one_printable_line():
    assert printable("\x1b[31mred\u202e\n\u2028line\ud800") == "[31mred   line"
    assert printable("x" * 10_000) == "x" * 500 and printable("abc", 2) == "ab"


def test_nothing_is_hidden_from_who_decides():
    assert visible("http://host/é") == "http://host/é"
    assert visible("a\u202eb\x1b[2J") == "'a\\u202eb\\x1b[2J'"


def test_what_is_stored_comes_back():
    kept = safe_text("a\0b\ud800c" + "x" * MAX_TEXT)
    assert len(kept) == MAX_TEXT and kept.startswith("a\N{REPLACEMENT CHARACTER}b?c")
    (back,) = sqlite3.connect(":memory:").execute("SELECT ?", (kept,)).fetchone()
    assert back == kept
