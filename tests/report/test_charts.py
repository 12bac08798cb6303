import dataclasses
import json
import math

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from openeureka.report import charts, family, html, verdict
from openeureka.report.charts import MAX_POINTS

from .search import BASELINES, HISTORY, finished, run, trained, view


def components(*curves: tuple[float | None, ...]) -> charts.Chart | None:
    entry = trained(0, 0, 1.0)
    assert entry.result is not None
    named = {f"component/{index}": curve for index, curve in enumerate(curves)}
    return charts.components(dataclasses.replace(entry.result, curves=named))


def test_undefined_and_absurd_values_are_gaps():
    chart = components((1.0, None, 2.0, 1e300, 3.0))
    assert chart is not None
    assert chart.lines[0].values == (1.0, None, 2.0, None, 3.0)


def test_long_curves_are_thinned_and_keep_their_end():
    chart = components(tuple(float(n) for n in range(10_001)))
    assert chart is not None
    assert len(chart.xs) == len(chart.lines[0].values) <= MAX_POINTS + 1
    assert (chart.xs[-1], chart.lines[0].values[-1]) == (10_000, 10_000.0)


def test_curves_of_different_lengths_share_places_and_each_keeps_its_end():
    chart = components((0.0, 1.0, 2.0, 3.0), (5.0, 6.0))
    assert chart is not None
    assert chart.xs == (0, 1, 2, 3)
    assert [line.values for line in chart.lines] == [(0.0, 1.0, 2.0, 3.0), (5.0, 6.0, None, None)]


def test_more_lines_than_colours_are_named():
    chart = components(*[(0.0, 1.0)] * 14)
    assert chart is not None
    assert (len(chart.lines), chart.note) == (12, "2 more components are not drawn.")


def test_progress_shows_candidates_in_order_the_best_so_far_and_the_baselines():
    chart = charts.progress(run(HISTORY, BASELINES))
    assert chart is not None
    assert {line.name: line.values for line in chart.lines} == {
        "candidate": (10.0, 30.0, None, 20.0, None, 50.0),
        "best so far": (10.0, 30.0, 30.0, 30.0, 30.0, 50.0),
        "human reward": (60.0,) * 6,
        "sparse reward": (20.0,) * 6,
    }
    assert chart.names == ("g0s0", "g0s1", "g0s2", "g1s0", "g1s1", "g2s0")
    whole = run(HISTORY, BASELINES)
    first, *rest = whole.generations
    rejected = (first.candidates[0], dataclasses.replace(first.candidates[1], vetoed=True), *first.candidates[2:])
    chart = charts.progress(
        dataclasses.replace(whole, generations=(dataclasses.replace(first, candidates=rejected), *rest))
    )
    assert chart is not None
    assert chart.lines[1].values == (10.0, 10.0, 10.0, 20.0, 20.0, 50.0)
    assert chart.bounds == (0, 3, 5)


def test_runs_of_different_tasks_are_not_drawn_on_one_scale_and_one_alone_is_not_drawn():
    ant, pen = (
        dataclasses.replace(finished(), config=dataclasses.replace(finished().config, env=env))
        for env in ("ant", "pen")
    )
    drawn = charts.best_by_candidate({"a": finished(), "b": ant, "c": finished(), "d": pen, "e": ant})
    assert [[line.name for line in chart.lines] for chart in drawn] == [["a", "c"], ["b", "e"]]
    assert drawn[1].title == "ant: best F so far"


def test_nothing_defined_is_no_chart():
    assert components((None, None)) is None
    assert charts.learning(view(trained(0, 0, None)), {}) is None


def test_steps_hold_what_was_reached_until_more_is():
    chart = charts.spending("", {"a": [(1e6, 1.0), (3e6, 2.0)], "b": [(2e6, 5.0)]}, {"human": 4.0})
    assert chart is not None
    assert chart.xs == (1.0, 2.0, 3.0)
    assert [line.values for line in chart.lines] == [(1.0, 1.0, 2.0), (None, 5.0, 5.0), (4.0, 4.0, 4.0)]


def test_a_level_has_a_colour_that_no_line_has():
    lines = {name: [(1e6, 1.0), (3e6, 2.0)] for name in ("a", "b", "c")}
    chart = charts.spending("", lines, {"human": 4.0})
    assert chart is not None and len({line.color for line in chart.lines}) == 4


def test_the_human_reward_has_one_colour_in_every_picture(tmp_path):
    human = charts.BESIDE["human reward"]
    shown, lone = finished(), {result.lane.partition("-")[0]: result for result in BASELINES[:1]}
    drawn = [charts.progress(shown), charts.learning(shown.candidates[0], lone)]
    found = [line.color for chart in drawn if chart for line in chart.lines if line.name == "human reward"]
    assert found == [human, human]
    assert f'class="h{human}"' in html.report(shown, tmp_path)  # in the plot of the verdict
    others = [line.color for chart in drawn if chart for line in chart.lines if line.name != "human reward"]
    assert human not in others


def test_a_family_stands_in_columns_with_shades_from_the_lowest_f_to_the_highest():
    parent, other = trained(0, 0, 10.0), trained(0, 1, 30.0)
    child = dataclasses.replace(view(trained(1, 0, 20.0)), parent=other.sample)
    shown = run(HISTORY)
    generations = [
        dataclasses.replace(shown.generations[0], candidates=(view(parent), view(other))),
        dataclasses.replace(shown.generations[1], candidates=(child, view(trained(1, 1, None)))),
    ]
    tree = family.of(dataclasses.replace(shown, generations=tuple(generations)))
    assert tree is not None
    found = {str(member.place): member for member in tree.members}
    assert {name: member.shade for name, member in found.items()} == {"g0s0": 0, "g0s1": 8, "g1s0": 4, "g1s1": None}
    assert found["g1s0"].parent == (found["g0s1"].x, found["g0s1"].y)
    assert all(0 < member.x < tree.width and 0 < member.y < tree.height for member in tree.members)
    assert family.of(shown) is None  # nobody has a parent


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])  # both go by the clock
@given(st.lists(st.none() | st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=20))
def test_every_value_that_is_drawn_is_a_number_of_strict_json(values):
    chart = components(tuple(values))
    if chart is not None:
        data = json.loads(html.data(chart), parse_constant=lambda _: 1 / 0)
        assert len(data["xs"]) == len(data["lines"][0]["values"])
        assert all(value is None or math.isfinite(value) for value in data["lines"][0]["values"])


def test_a_curve_as_small_as_a_word_fills_its_box():
    assert charts.spark((0.0, 5.0, 10.0)) == "1.0,19.0 40.0,10.0 79.0,1.0"
    assert charts.spark((None, 1.0)) == ""


def test_what_ppo_did_is_no_component():
    entry = trained(0, 0, 1.0)
    assert entry.result is not None
    curves = {**entry.result.curves, "ppo/kl": (0.008, 0.01)}
    entry = dataclasses.replace(entry, result=dataclasses.replace(entry.result, curves=curves))
    chart = charts.components(entry.result)
    assert chart is not None and [line.name for line in chart.lines] == ["$upright"]
    assert "ppo" not in verdict.components(finished()) and verdict.components(finished())
