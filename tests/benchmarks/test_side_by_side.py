"""benchmarks/side_by_side.py, except the trainings and what MuJoCo draws."""

import numpy as np
import side_by_side
import table
from PIL import Image, ImageColor
from records import read
from side_by_side import FLASH, GREEN, STRIP, TILE, Moment


def shade(grey: int) -> Image.Image:
    return Image.new("RGB", TILE, (grey, grey, grey))


def test_the_seed_is_the_one_with_the_middle_score():
    row = {"confirmed": {"seeds": [4, 5, 6, 7, 8], "generated": [0.9, 0.1, 0.5, 0.2, 0.8]}}
    assert side_by_side.seed(row) == 6


def test_the_tasks_are_some_on_which_the_generated_reward_is_better():
    rows = read(table.RESULTS)
    assert all(rows[env]["confirmed"]["difference"][1] > 0 for env in side_by_side.TASKS)


def test_a_column_is_a_task_and_a_row_is_a_reward():
    tasks = [[[Moment(shade(40 * column + 100 * row), 0, 0)] for row in range(2)] for column in range(3)]
    whole = np.asarray(side_by_side.picture(tasks, 0))
    rows = [2 * STRIP + TILE[1] // 2, 3 * STRIP + TILE[1] + TILE[1] // 2]
    columns = [(column * 2 + 1) * TILE[0] // 2 for column in range(3)]
    assert whole[np.ix_(rows, columns)][..., 0].tolist() == [[0, 40, 80], [100, 140, 180]]


def test_a_success_has_a_green_rim_for_some_time():
    moments = [Moment(shade(9), int(index >= 3), int(index >= 3)) for index in range(3 + 2 * FLASH)]
    rims = [side_by_side.frame(moments, index, "human reward").getpixel((0, STRIP)) for index in range(len(moments))]
    assert [rim == ImageColor.getrgb(GREEN) for rim in rims] == [3 <= index < 3 + FLASH for index in range(len(rims))]
