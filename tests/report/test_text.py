import pytest

from openeureka.report.text import columns, duration, number, one_line, plain, spread


@pytest.mark.parametrize(
    ("text", "safe"),
    [
        ("\x1b[31mred\x1b[0m", "red"),
        ("\x1b]0;window title\x07after", "after"),
        ("\x1b]8;;http://x\x1b\\link", "link"),
        ("a\x9b31mb", "a31mb"),  # the one-byte form of ESC [
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


def test_columns_are_as_wide_as_their_widest_cell():
    assert columns([("a", "bb"), ("ccc", "d")]) == "a    bb\nccc  d"


def test_numbers_and_durations_for_people():
    assert (number(None), number(498.76543), number(-0.000123456)) == ("-", "498.8", "-0.0001235")
    assert (duration(41.6), duration(185), duration(7810)) == ("42 s", "3 min 05 s", "2 h 10 min")


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ((), "-"),
        ((None, None), "-"),
        ((5.0,), "5"),
        ((2.0, 4.0, 6.0), "4 ± 2"),  # sample deviation sqrt((4 + 0 + 4) / 2)
        ((2.0, None), "2 (1 undefined)"),
    ],
)
def test_spread_is_mean_and_sample_deviation_of_the_defined_values(values, text):
    assert spread(values) == text
