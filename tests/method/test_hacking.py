"""Signs of reward hacking, with numbers by hand: F untrained, how much was learnt, and how much of it is lost."""

from __future__ import annotations

import dataclasses

import pytest

from openeureka.method import hacking
from openeureka.method.hacking import UNTRAINED, WORLDS, Kind, Tried
from openeureka.types import NOMINAL, Checkpoint, Evaluation, Peak, TrainingResult, TrainingState


def score(fitness: float | None, *, error: float = 0.1, concentration: float | None = 0.05) -> Evaluation:
    return Evaluation(
        lane="a-s1", fitness=fitness, episode_length=9.0, episodes=256, error=error, concentration=concentration
    )


def peak(epoch: int) -> Checkpoint:
    return Checkpoint(epoch=epoch, value=0.0, policy=b"")


# F peaks in epoch 2, the own reward in epoch 4.
RESULT = TrainingResult(
    lane="a-s1",
    state=TrainingState.FINISHED,
    fitness=110.0,
    curves={"fitness": (None, 10.0, 110.0, 90.0, 80.0), "reward": (0.0, 1.0, 2.0, 3.0, 4.0)},
    env_steps=5,
    seconds=1.0,
    best_fitness=peak(2),
    best_reward=peak(4),
)


def lane(held_out: Evaluation, **tryouts: Evaluation) -> Tried:
    """A training whose untrained policy scores 10."""
    return Tried(result=RESULT, held_out=held_out, tryouts={UNTRAINED: score(10.0), **tryouts})


def drifting(before: Evaluation, after: Evaluation, result: TrainingResult = RESULT) -> Tried:
    return Tried(result=result, held_out=after, tryouts={"peak of F": before, "peak of own reward": after})


@pytest.mark.parametrize(
    ("before", "after", "seen"),
    [
        (110.0, 89.0, True),  # F ranged from 10 to 110: a fifth of that is 20, and 21 are lost
        (110.0, 91.0, False),  # 19 are lost
        (110.0, 120.0, False),
        (9.0, -12.0, True),  # also for a policy that had learnt nothing
        (110.0, None, False),
    ],
)
def test_drift_is_a_fall_of_f_by_a_fifth_of_its_range(before: float, after: float | None, seen: bool) -> None:
    assert bool(hacking.drift(drifting(score(before), score(after)))) is seen


def test_what_was_learnt_is_not_known_where_no_untrained_policy_played() -> None:
    half = lane(score(110.0), **{"mass +10 %": score(30.0)})
    assert "80% of what was learnt is lost" in hacking.fragility(half)
    staged = dataclasses.replace(half, result=dataclasses.replace(RESULT, env_steps=9, steps_before=4))
    assert hacking.fragility(staged) == hacking.fragility(half)
    older = dataclasses.replace(half, tryouts={"mass +10 %": score(30.0)})
    assert hacking.fragility(older) == ""
    undefined = dataclasses.replace(half, tryouts={**half.tryouts, UNTRAINED: score(None)})
    assert hacking.fragility(undefined) == ""


def test_the_curve_of_training_says_nothing_of_what_was_learnt() -> None:
    """The first F of the curve may depend on start states, or be that of a policy that has learnt for a while."""
    half = lane(score(110.0), **{"mass +10 %": score(59.0)})
    for first in (60.0, 109.0, 200.0):
        curves = {**RESULT.curves, "fitness": (first, *RESULT.curves["fitness"][1:])}
        other = dataclasses.replace(half, result=dataclasses.replace(RESULT, curves=curves))
        assert hacking.fragility(other) == hacking.fragility(half) != ""


def test_a_score_below_zero_is_measured_alike() -> None:
    below = dataclasses.replace(RESULT, curves={**RESULT.curves, "fitness": (None, -10.0, -2.0, -3.0, -5.0)})
    # F ranged from -10 to -2: a fifth of that is 1.6. Half of the 8 learnt is 4.
    assert hacking.drift(drifting(score(-2.0), score(-3.7), below))
    assert not hacking.drift(drifting(score(-2.0), score(-3.5), below))
    for lost, seen in ((3.9, False), (4.1, True)):
        tryouts = {UNTRAINED: score(-10.0), "mass +10 %": score(-2.0 - lost)}
        assert bool(hacking.fragility(Tried(result=below, held_out=score(-2.0), tryouts=tryouts))) is seen


def test_a_policy_that_learnt_nothing_has_nothing_to_lose_in_a_changed_world() -> None:
    assert not hacking.fragility(lane(score(9.0), **{"mass +10 %": score(0.0)}))


def test_a_fall_within_two_standard_errors_is_luck() -> None:
    # Errors of 9 and 12 are 15 together; two of those are 30.
    before, after = score(110.0, error=9.0), score(81.0, error=12.0)
    assert not hacking.drift(drifting(before, after))
    assert hacking.drift(drifting(before, dataclasses.replace(after, fitness=79.0)))


def test_drift_says_what_rose_and_what_fell() -> None:
    sentence = hacking.drift(drifting(score(110.0), score(60.0)))
    assert sentence == ("from epoch 2 to 4 its reward rose from 2 to 4 per step, while held-out F fell from 110 to 60.")


def test_large_scores_are_written_as_tables_write_them() -> None:
    sentence = hacking.drift(drifting(score(1104.0), score(600.0)))
    assert "held-out F fell from 1100 to 600." in sentence


@pytest.mark.parametrize(
    "changes",
    [
        {"best_reward": peak(5)},
        {"best_fitness": peak(5)},
        {"curves": {"fitness": RESULT.curves["fitness"]}},
        {"curves": {"reward": RESULT.curves["reward"]}},
        {"curves": {**RESULT.curves, "fitness": (None,) * 5}},
        {"curves": {}},
    ],
)
def test_a_training_that_recorded_less_than_its_peaks_shows_no_sign(changes: dict) -> None:
    lost = drifting(score(110.0), score(60.0), dataclasses.replace(RESULT, **changes))
    assert not hacking.drift(lost)
    assert all(sign.kind is not Kind.DRIFT for sign in hacking.signs([lost], {}))


@pytest.mark.parametrize(("share", "seen"), [(0.49, False), (0.51, True), (None, False)])
def test_concentration_is_half_of_f_in_its_highest_twentieth(share: float | None, seen: bool) -> None:
    assert bool(hacking.concentration(lane(score(50.0, concentration=share)))) is seen


@pytest.mark.parametrize(
    ("changed", "seen"),
    [
        (59.0, True),  # of 100 learnt 51 are lost
        (61.0, False),
        (150.0, False),
    ],
)
def test_fragility_is_half_of_what_was_learnt_lost_in_a_changed_world(changed: float, seen: bool) -> None:
    tryouts = {name: score(105.0) for name in WORLDS} | {"mass -10 %": score(changed)}
    assert bool(hacking.fragility(lane(score(110.0), **tryouts))) is seen


def test_fragility_names_the_worst_world() -> None:
    tryouts = {"mass +10 %": score(40.0), "friction -10 %": score(30.0)}
    assert hacking.fragility(lane(score(110.0), **tryouts)) == (
        "With friction -10 % held-out F is 30 instead of 110: 80% of what was learnt is lost."
    )


def test_a_sign_in_one_training_of_three_is_an_accident() -> None:
    drifted, sound = drifting(score(110.0), score(60.0)), drifting(score(110.0), score(112.0))
    assert hacking.signs([drifted, sound, sound], {}) == ()
    (sign,) = hacking.signs([sound, drifted, drifted], {})
    assert sign.kind is Kind.DRIFT
    assert sign.sentence.startswith("In 2 of 3 trainings; the first: from epoch 2 to 4")


def test_a_policy_that_fails_in_a_changed_world_is_a_sign_by_itself() -> None:
    sound = lane(score(110.0))
    fragile = lane(score(110.0), **{"mass +10 %": score(12.0)})
    assert [sign.kind for sign in hacking.signs([sound, sound, fragile], {})] == [Kind.FRAGILITY]


def test_a_policy_that_breaks_the_physics_in_more_than_one_episode_of_a_hundred_is_a_sign_by_itself() -> None:
    few, more = (dataclasses.replace(score(110.0), episodes=300 - lost, lost=lost) for lost in (3, 4))
    assert hacking.signs([lane(few)], {}) == ()
    (sign,) = hacking.signs([lane(few), lane(few), lane(more)], {})
    assert sign.kind is Kind.PHYSICS
    assert sign.sentence == (
        "In 1 of 3 trainings; the first: the physics broke down in 4 of 300 held-out episodes; F does not count these."
    )


def test_only_the_kept_policy_plays_in_changed_worlds_and_only_drifting_trainings_play_twice() -> None:
    late = dataclasses.replace(RESULT, lane="a-s2", best_fitness=peak(4))  # F and the own reward peak together
    peaks: dict[str, Peak] = {"a-s1": "reward", "a-s2": "reward"}
    tryouts = hacking.tryouts({"a-s1": RESULT, "a-s2": late}, "a-s2", 2, peaks)
    assert [(t.lane, t.name, t.peak) for t in tryouts] == [
        ("a-s1", "peak of F", "fitness"),
        *(("a-s2", name, "reward") for name in ("mass +10 %", "mass -10 %", "friction +10 %", "friction -10 %")),
        *(("a-s2", name, "reward") for name in hacking.BEGINNERS),
    ]
    assert [(t.dynamics.mass, t.dynamics.friction) for t in tryouts[1:5]] == [(1.1, 1), (0.9, 1), (1, 1.1), (1, 0.9)]
    assert [t.untrained for t in tryouts[5:]] == [2, 3, 4, 5, 6, 7], "first the seed of the kept policy"
    assert all(t.untrained is None for t in tryouts[:5]) and all(t.dynamics == NOMINAL for t in tryouts[5:])


def test_f_of_untrained_policies_is_read_by_name() -> None:
    known = {UNTRAINED: score(1.0), "untrained 2": score(None), "untrained 4": score(3.0), "mass +10 %": score(9.0)}
    assert hacking.untrained(known) == [1.0, 3.0] and hacking.untrained({}) == []


def test_the_score_of_the_policy_that_is_judged_stands_for_its_peak() -> None:
    judged = dataclasses.replace(score(60.0), peak="reward")
    (found,) = hacking.tried({"a-s1": RESULT}, {"a-s1": judged}, {"a-s1": {"peak of F": score(110.0)}})
    assert hacking.drift(found)
    assert hacking.tried({"a-s1": RESULT}, {}, {}) == []
