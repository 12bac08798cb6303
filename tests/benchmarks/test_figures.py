"""scripts/figures.py: what its pictures hold."""

import figures
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that the script draws."""
    found, written = list[Figure](), figures._svg

    def kept(figure: Figure) -> str:
        found.append(figure)
        return written(figure)

    monkeypatch.setattr(figures, "_svg", kept)
    return found


def test_names_of_rows_that_end_alike_stand_above_each_other(drawn: list[Figure]):
    rows = [
        ("shadow_hand_door_close_outward", "better", 0.6, 2.46),
        ("shadow_hand_door_open_inward", "better", 0.44, 2.35),
        ("shadow_hand_catch_underarm", "better", 0.5, 2.4),
        ("ant", "worse", 0.5, -1.1),
        ("anymal", "level", 0.5, 0.4),
    ]
    figures.novelty(rows)
    (figure,) = drawn
    (axes,), canvas = figure.axes, FigureCanvasAgg(figure)
    canvas.draw()
    boxes = {text.get_text(): text.get_window_extent(canvas.get_renderer()) for text in axes.texts}
    assert sorted(boxes) == sorted(task for task, ending, *_ in rows if ending != "level")
    assert not [(one, two) for one in boxes for two in boxes if one < two and boxes[one].overlaps(boxes[two])]


def test_every_row_has_a_mark_at_its_mean_and_each_ending_a_colour_of_its_own(drawn: list[Figure]):
    rows = [
        ("ant", "better", 0.5, 0.1, 0.9),
        ("anymal", "level", 0.0, 0.0, 0.0),
        ("pen", "too few seeds", 0.2, -1.0, 1.4),
        ("over", "worse", -0.5, -0.9, -0.1),
    ]
    figures.bars(rows)
    ((axes,),) = (figure.axes for figure in drawn)
    marks = [line for line in axes.lines if line.get_marker() == "o"]
    assert [(line.get_xdata()[0], line.get_ydata()[0]) for line in marks] == [(0.5, 0), (0.0, 1), (0.2, 2), (-0.5, 3)]
    assert len({to_hex(bar.get_facecolor()) for bar in axes.patches}) == len(rows)
