"""A stored plan still does its task, a plan without pushes does not, and a search always plays from the same start."""

import reachable

SURE = "shadow_hand_door_close_outward"
"""Its plan closes the doors with room to spare, so rounding on another machine does not matter."""


def test_a_plan_that_was_found_does_its_task_again():
    found = reachable.read(reachable.RESULTS)[SURE]
    assert found["f"] == 1.0
    assert reachable.replay(SURE, found["plan"], found["steps"], [reachable.SEED]) == 1.0


def test_a_plan_of_no_pushes_does_not():
    found = reachable.read(reachable.RESULTS)[SURE]
    idle = [[0.0] * len(row) for row in found["plan"]]
    assert reachable.replay(SURE, idle, found["steps"], [reachable.SEED]) == 0.0


def test_a_search_keeps_to_the_same_start():
    """If the start changed from round to round, a plan could be kept for what it does from another start."""
    task = "shadow_hand_catch_underarm"
    (aim,) = (aim for aim in reachable.AIMS if aim.env == task)
    env = reachable.registry.make(task, worlds=1, lane_seeds=[reachable.SEED] * 2)
    plans = reachable.plan_of(aim, {}).expand(2, -1, -1)
    first, again = (reachable.played(env, plans, 3, aim, 3)[0] for _ in range(2))
    assert first.tolist() == again.tolist()
    assert first[0] == first[1]
