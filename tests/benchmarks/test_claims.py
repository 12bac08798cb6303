"""The interval over rewards decides whether a claim holds, and every group that is compared has its replies stored."""

from collections.abc import Sequence

import claims
import pytest

from openeureka.reward import extract


def group(scores: Sequence[float | None]) -> dict[str, object]:
    return {"replies": 8, "scores": list(scores)}


def test_a_claim_is_decided_by_its_interval():
    low, high = [0.9, 1.0, 1.1, 1.0], [2.0, 2.1, 1.9, None]
    measured = {"ant": {"first": group(low), "reflection": group(high), "scores": group([1.9, 2.1]), "init": group([])}}
    told = {claim: holds for claim, _, _, holds in claims.answers(measured)}
    assert told == {"Later generations are better": "yes", "Reflection helps": "not decided"}
    other = {"ant": {"first": group(high), "reflection": group(low)}}
    assert [row[-1] for row in claims.answers(other)] == ["no, the reverse"]


def test_tasks_count_alike_whatever_their_scores():
    low, high = [0.0, 1.0, 2.0], [6.0, 7.0, 8.0]
    measured = {
        "ant": {"first": group(low), "reflection": group(high)},
        "ballbalance": {"first": group([100 * x for x in low]), "reflection": group([100 * x for x in low])},
    }
    *_, (_, env, told, holds) = claims.answers(measured)
    assert env == "all, in standard deviations" and holds == "yes"  # a gain of six on one task, none on the other
    assert told.startswith("3 (")
    half = 4.3147 * (2 / 3) ** 0.5  # Student's t, four degrees of freedom, 5 % / 8 on each side
    assert claims.together([(high, low)]) == pytest.approx([6.0, 6.0 - half, 6.0 + half], 1e-3)


def test_four_claims_are_asked_so_each_takes_more_to_hold():
    low, high = [0.0, 1.0, 2.0], [3.0, 4.0, 5.0]  # 3 ± 2.27 alone, 3 ± 3.52 as one of four claims
    measured = {"ant": {"first": group(low), "reflection": group(high)}}
    assert [row[-1] for row in claims.answers(measured)] == ["not decided"]


def test_a_task_whose_rewards_all_score_the_same_tells_nothing():
    measured = {"cartpole": {"first": group([499.0] * 8), "reflection": group([498.0] * 8)}}
    assert not claims.answers(measured)


def test_a_row_counts_refusals_and_leaves_out_what_gave_no_score():
    measured = {"ant": {"first": {**group([1.0, 3.0, None]), "human": 2.5}, "local": group([])}}
    first, local = claims.rows(measured)
    assert first[:3] == ("ant", "first generation", "3 of 8") and first[4:] == ("3", "2.5")
    assert local[2:] == ("0 of 8", "-", "-", "-")


def test_every_group_has_eight_programs():
    for env in claims.STEPS:
        for name in claims.GROUPS:
            replies = claims.asked(env, name)
            asked = env not in claims.LONGER or name in ("first", "reflection")
            assert len(replies) == 8 * asked and all(map(extract.program, replies))
    first, second = claims.asked("anymal", "first"), claims.asked("anymal", "reflection")
    assert not set(first) & set(second)


def test_what_the_sandbox_refuses_trains_not():
    good = "```python\ndef compute_reward(up_proj):\n    return up_proj, {'up': up_proj}\n```"
    assert len(claims.accepted("ant", [good, good, "no program", good.replace("up_proj,", "open('x'),", 1)])) == 1
