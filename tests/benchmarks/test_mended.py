"""Tasks whose prompts contained an error, searched again with corrected prompts."""

from pathlib import Path

import mended
import table

from openeureka.benchmark.plan import load
from openeureka.llm.replay import archived


def test_nothing_but_the_replies_differs_from_the_table():
    whole, faulty = load(mended.PLAN), load(table.PLAN)
    for cell in whole.cells():
        (first,) = (other for other in faulty.cells() if other.task == cell.task)
        config, before = whole.config(cell), faulty.config(first)
        replies, eight = (archived(Path(one.model.removeprefix("replay:"))) for one in (config, before))
        assert len(replies) == len(eight) == config.sample == 8
        assert not {reply.text for reply in replies} & {reply.text for reply in eight}, cell.task
        same = ("steps", "iteration", "seeds", "seed", "worlds", "schedule", "search")
        assert [getattr(config, name) for name in same] == [getattr(before, name) for name in same], cell.task


def test_intervals_of_the_ten_tasks_hold_together():
    # Student's t with 4 degrees of freedom is 2.78 for one interval and 5.6 for ten. The difference has a standard
    # error of 0.816.
    apart = {"seeds": [1, 2, 3], "generated": [4.0, 5.0, 6.0], "human": [1.0, 2.0, 3.0], "difference": [3, 0.7, 5.3]}
    ((task, *_, between, ending, crowned),) = mended.rows({"ant": {"crowned": "g0s1", "steps": 1, "confirmed": apart}})
    assert (task, between, ending, crowned) == ("ant", "3 (-1.57 to 7.57)", "level", "g0s1")
    assert mended.summary({"ant": {"confirmed": apart}}).startswith("With the mended prompts, the generated reward is")
