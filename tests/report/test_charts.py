import dataclasses
import math

from hypothesis import given
from hypothesis import strategies as st

from openeureka.report import charts, verdict
from openeureka.report.charts import BOTTOM, HEIGHT, LEFT, MAX_POINTS, RIGHT, TOP, WIDTH

from .search import BASELINES, HISTORY, finished, run, trained, view


def components(*curves: tuple[float | None, ...]) -> charts.Chart | None:
    entry = trained(0, 0, 1.0)
    assert entry.result is not None
    named = {f"component/{index}": curve for index, curve in enumerate(curves)}
    return charts.components(dataclasses.replace(entry.result, curves=named))


def test_a_curve_is_scaled_between_round_numbers():
    chart = components((0.0, 5.0, 9.0))
    assert chart is not None
    # Axes: 0 1 2 epochs, 0 5 10.
    assert [tick.label for tick in chart.y_ticks] == ["0", "5", "10"]
    assert [tick.label for tick in chart.x_ticks] == ["0", "1", "2"]
    middle = (LEFT + (WIDTH - LEFT - RIGHT) / 2, HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) / 2)
    assert chart.lines[0].pieces[0][1] == middle


def test_undefined_and_absurd_values_are_gaps():
    chart = components((1.0, None, 2.0, 1e300, 3.0))
    assert chart is not None
    assert [len(piece) for piece in chart.lines[0].pieces] == [1, 1, 1]


def test_long_curves_are_thinned_and_keep_their_end():
    chart = components(tuple(float(n) for n in range(10_001)))
    assert chart is not None
    points = chart.lines[0].pieces[0]
    assert len(points) <= MAX_POINTS + 1
    assert points[-1] == (WIDTH - RIGHT, TOP)  # both axes end at 10000


def test_more_lines_than_colours_are_named():
    chart = components(*[(0.0, 1.0)] * 14)
    assert chart is not None
    assert (len(chart.lines), chart.note) == (12, "2 more components are not drawn.")


def test_progress_shows_candidates_the_best_so_far_and_the_baselines():
    chart = charts.progress(run(HISTORY, BASELINES))
    assert chart is not None
    assert {line.name: sum(map(len, line.pieces)) for line in chart.lines} == {
        "candidate": 4,
        "best so far": 3,
        "human reward": 2,
        "sparse reward": 2,
    }


def test_nothing_defined_is_no_chart():
    assert components((None, None)) is None
    assert charts.learning(view(trained(0, 0, None)), {}) is None


@given(st.lists(st.none() | st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=20))
def test_every_point_lies_within_the_picture(values):
    chart = components(tuple(values))
    for line in chart.lines if chart else ():
        for x, y in (point for piece in line.pieces for point in piece):
            assert math.isfinite(x) and LEFT <= x <= WIDTH - RIGHT
            assert math.isfinite(y) and TOP <= y <= HEIGHT - BOTTOM


def test_what_ppo_did_is_no_component():
    entry = trained(0, 0, 1.0)
    assert entry.result is not None
    curves = {**entry.result.curves, "ppo/kl": (0.008, 0.01)}
    entry = dataclasses.replace(entry, result=dataclasses.replace(entry.result, curves=curves))
    chart = charts.components(entry.result)
    assert chart is not None and [line.name for line in chart.lines] == ["$upright"]
    assert "ppo" not in verdict.why(finished()) and verdict.why(finished())
