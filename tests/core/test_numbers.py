import pytest

from openeureka.numbers import columns, dollars, duration, number, spread


def test_columns_are_as_wide_as_their_widest_cell():
    assert columns([("a", "bb"), ("ccc", "d")]) == "a    bb\nccc  d"


def test_numbers_and_durations_for_people():
    assert (number(None), number(498.76543), number(-0.000123456)) == ("-", "498.8", "-0.0001235")
    assert (number(123_456.0), number(999_400.0), number(1_500_000.0)) == ("123500", "999400", "1.5e+06")
    assert (dollars(0.0), dollars(0.00012), dollars(1234.5)) == ("0", "0.0001", "1,234.50")
    assert (duration(41.6), duration(185), duration(7810)) == ("42 s", "3 min 05 s", "2 h 10 min")


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ((), "-"),
        ((None, None), "-"),
        ((5.0,), "5"),
        ((2.0, 4.0, 6.0), "4.0 ± 2.0"),  # sample deviation sqrt((4 + 0 + 4) / 2)
        ((0.0, 0.0, 0.234375), "0.08 ± 0.14"),  # 0.0781 and 0.1353
        ((428.3, 416.2, 438.9), "428 ± 11"),
        ((1.0, 1.0), "1 ± 0"),
        ((3e9, 5e9), "4e+09 ± 1.4e+09"),
        ((2.0, None), "2 (1 undefined)"),
    ],
)
def test_spread_is_mean_and_sample_deviation_of_the_defined_values(values, text):
    assert spread(values) == text
