"""What a screen picks, against what chance picks of the same rewards."""

import pytest
import screening
from screening import Pool, Scores

from openeureka.types import Episodes

GOOD, BAD = [f"good{number}" for number in range(20)], [f"bad{number}" for number in range(12)]


@pytest.fixture
def pool() -> Pool:
    """Good rewards pay for F, are worth 1 and play 1; bad ones pay against it and are worth 0. No two are alike."""
    names = [*GOOD, *BAD]
    lanes = [*(f"{name}-s0" for name in names), "human-s0", "sparse-s0"]
    fitness = (0.0, 1.0, 2.0, 3.0)
    episodes = {lane: Episodes(fitness=fitness, steps=(1,) * 4, owners=(0, 1, 2, 3)) for lane in lanes}

    def paid(name: str, number: int) -> list[float]:
        sign = 1.0 if name in GOOD else -1.0
        return [sign * value + number / 100 * value**2 for value in fitness]

    return Pool(
        scores={name: Scores(float(name in GOOD), float(name in GOOD)) for name in names},
        episodes=episodes,
        paid={name: dict.fromkeys(lanes, paid(name, number)) for number, name in enumerate(names)},
    )


def test_rewards_that_pay_against_f_are_dropped_and_chance_takes_its_share_of_them(pool: Pool) -> None:
    found = screening.searched(pool, [*GOOD[:4], *BAD[:4], *GOOD[4:], *BAD[4:]])
    assert (found.best, found.mean) == (1.0, 1.0)
    assert (found.dropped, found.dropped_sum) == (8, 0.0)
    assert found.mean_by_chance == pytest.approx(16 / 24)
    assert found.best_by_chance == pytest.approx(1 - 1 / 735471)  # one of the C(24, 8) choices has only bad ones


def test_chance_misses_the_best_as_often_as_it_is_left_out() -> None:
    scores = [Scores(float(number), float(10 * number)) for number in range(9)]
    assert screening.by_chance(scores) == pytest.approx(80 * 8 / 9 + 70 / 9)


def test_the_interval_grows_with_what_one_reward_matters() -> None:
    assert screening._between(1.0, [1.0] * 32) == [1.0, 1.0, 1.0]
    value, low, high = screening._between(1.0, [0.9, 1.1])
    error = (0.5 * (0.1**2 + 0.1**2)) ** 0.5
    assert (value, low, high) == pytest.approx((1.0, 1.0 - 1.96 * error, 1.0 + 1.96 * error))


def test_a_row_tells_the_dropped_from_the_others() -> None:
    own = {
        "scores": dict.fromkeys(range(32)),
        "found": {"best": 9, "best_by_chance": 8, "mean": 5, "mean_by_chance": 4, "dropped": 4, "dropped_sum": 8},
        "best": [1, -1, 3],
        "mean": [1, 0.5, 1.5],
    }
    (row,) = screening.rows({"ant": own})
    assert row[-3:] == ("4.0 of 24", "2", "4.4")  # (24 x 4 - 8) / 20
    assert "better than the best of what chance picks on 0 of 1 tasks, worse on 0" in screening.summary({"ant": own})
