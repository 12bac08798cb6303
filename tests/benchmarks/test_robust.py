"""What ranges are worth, from the records of seeds."""

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import robust


def seed(**arms: tuple[float | None, float | None]) -> dict[str, Any]:
    return {"arms": {name: {"nominal": own, "hard": hard} for name, (own, hard) in arms.items()}}


def test_losses_are_shares_of_what_the_plain_policy_has_and_loses():
    seeds = {
        "0": seed(plain=(10.0, 6.0), uniform=(8.0, 7.0), ours=(9.0, 8.0)),
        "1": seed(plain=(10.0, 4.0), uniform=(8.0, 7.0), ours=(10.0, 7.0)),
    }
    ((task, count, *scores, nominal, hard, uniform),) = robust.rows({"ant": seeds})
    assert (task, count, nominal, hard, uniform) == ("ant", "2", "5%", "40%", "20%")  # of 10; of the 5 that plain loses
    assert scores[1].startswith("5 ") and scores[5].startswith("7.5 ")


def test_of_a_negative_score_less_is_lost_too():
    ((*_, nominal, _, _),) = robust.rows(
        {"quadcopter": {"0": seed(plain=(-0.5, -0.6), uniform=(-1, -1), ours=(-0.4, -0.6))}}
    )
    assert nominal == "-20%"


def test_where_plain_loses_nothing_or_a_score_is_undefined_there_is_no_share():
    for plain in ((10.0, 10.0), (10.0, None)):
        ((*_, hard, _),) = robust.rows({"anymal": {"0": seed(plain=plain, uniform=(1.0, 1.0), ours=(9.0, 8.0))}})
        assert hard == "-"
