import math
from dataclasses import replace

import pytest

from openeureka.method import reflection
from openeureka.method.reflection import summary
from openeureka.types import (
    Candidate,
    Evaluation,
    Finding,
    Sample,
    Style,
    TrainingResult,
    TrainingState,
    Verdict,
    VerdictCode,
)

CANDIDATE = Candidate.of("program")
SAMPLE = Sample(
    generation=0, slot=0, candidate=CANDIDATE, verdict=Verdict(candidate=CANDIDATE.id, code=VerdictCode.ACCEPTED)
)
RESULT = TrainingResult(
    lane="a-s0",
    state=TrainingState.FINISHED,
    fitness=40.0,
    curves={
        "fitness": (None, *(float(epoch) for epoch in range(2, 41))),
        "episode_length": tuple(float(epoch) for epoch in range(1, 41)),
        "reward": (1.0,) * 40,
        "human_reward": (2.0,) * 40,
        "component/speed": tuple(epoch / 10 for epoch in range(1, 41)),
        "component/effort": (-0.00123,) * 39 + (math.nan,),
    },
    env_steps=1,
    seconds=1.0,
)


def reflect(
    sample: Sample, result: TrainingResult | None, style: Style, played: Evaluation | None = None, window: int = 1
) -> str:
    return reflection.reflect(sample, result, style, played, {}, window)


def test_feedback_says_that_a_curriculum_came_before() -> None:
    """The lists of the last stage begin high, so a level one does not mean that the reward teaches nothing."""
    staged = replace(RESULT, steps_before=4)
    for style in ("free", "grammar"):
        stage = "stage of a curriculum; it began with what the stages before had taught it"
        assert f", the last {stage}" in reflect(SAMPLE, staged, style)
        lost = replace(staged, state=TrainingState.DIVERGED, message="Stage 2: the policy was not finite")
        assert f", a {stage}" in reflect(SAMPLE, lost, style)
        assert stage not in reflect(SAMPLE, RESULT, style)


def test_feedback_on_a_training() -> None:
    # 40 epochs, ten points: epochs 1, 5, ..., 37. Means: speed (0.1 + 4) / 2, score (2 + 40) / 2, length (1 + 40) / 2.
    assert reflect(SAMPLE, RESULT, "free").splitlines() == [
        "A policy was trained with this reward function for 40 epochs. Each list begins with the first epoch and has a "
        "value every 4 epochs; Max, Mean and Min are over all of them. A component's value is its mean over all steps "
        "and environments of the epoch. task_score is the score of the policy in training, while it explored "
        "(none: too early to tell). "
        "episode_length is the mean of the episodes that ended in the epoch alone, at times a single one [steps].",
        "speed: [0.10, 0.50, 0.90, 1.30, 1.70, 2.10, 2.50, 2.90, 3.30, 3.70], Max: 4.00, Mean: 2.05, Min: 0.10",
        "effort: [" + ", ".join(["-0.0012"] * 10) + "], Max: -0.0012, Mean: -0.0012, Min: -0.0012",
        "task_score: [none, 5.00, 9.00, 13.00, 17.00, 21.00, 25.00, 29.00, 33.00, 37.00], Max: 40.00, Mean: 21.00, "
        "Min: 2.00",
        "episode_length: [1.00, 5.00, 9.00, 13.00, 17.00, 21.00, 25.00, 29.00, 33.00, 37.00], Max: 40.00, Mean: 20.50, "
        "Min: 1.00",
    ]


def test_a_score_that_looks_back_says_over_how_many_epochs() -> None:
    """In the list, a policy that no longer improves still rises, for as many epochs as the score averages."""
    played = Evaluation(lane="a-s0", fitness=38.0, episode_length=38.0, episodes=64, error=1.0)
    at_once = replace(RESULT, curves={**RESULT.curves, "fitness": RESULT.curves["human_reward"]})
    for found, end in ((None, "."), (played, "; rewards are ranked by the score when played instead.")):
        for result, late in ((RESULT, " (none: too early to tell)"), (at_once, "")):
            told = reflect(SAMPLE, result, "free", found, window=12)
            assert f"in training, while it explored, averaged over the last 12 epochs{late}{end} " in told
    assert "averaged" not in reflect(SAMPLE, RESULT, "free", played)


def test_the_model_is_not_shown_what_ppo_did() -> None:
    names = ("surrogate_loss", "value_loss", "kl", "entropy", "learning_rate")
    more = replace(RESULT, curves={**RESULT.curves, **{f"ppo/{name}": (7.75,) * 40 for name in names}})
    played = Evaluation(lane="a-s0", fitness=38.0, episode_length=38.0, episodes=64, error=1.0)
    for style in ("free", "grammar"):
        assert reflect(SAMPLE, more, style, played) == reflect(SAMPLE, RESULT, style, played)


def test_where_played_policies_rank_the_score_in_training_is_told_apart() -> None:
    played = Evaluation(lane="a-s0", fitness=38.0, episode_length=38.0, episodes=64, error=1.0)
    told = reflect(SAMPLE, RESULT, "free", played).splitlines()
    assert "(none: too early to tell); rewards are ranked by the score when played instead. " in told[0]
    assert told[1:] == reflect(SAMPLE, RESULT, "free").splitlines()[1:]
    assert reflect(SAMPLE, RESULT, "grammar", played) == reflect(SAMPLE, RESULT, "grammar")


def test_feedback_for_small_models_has_fewer_points_and_no_advice() -> None:
    assert reflect(SAMPLE, RESULT, "grammar").splitlines() == [
        "speed: [0.1, 1.1, 2.1, 3.1], Max: 4.0, Mean: 2.0, Min: 0.1",
        "effort: [-0.0012, -0.0012, -0.0012, -0.0012], Max: -0.0012, Mean: -0.0012, Min: -0.0012",
        "task_score: [none, 11.0, 21.0, 31.0], Max: 40.0, Mean: 21.0, Min: 2.0",
        "episode_length: [1.0, 11.0, 21.0, 31.0], Max: 40.0, Mean: 20.5, Min: 1.0",
    ]


def test_where_played_policies_rank_components_are_told_early_and_late_in_an_episode() -> None:
    played = Evaluation(lane="a-s0", fitness=38.0, episode_length=38.0, episodes=64, error=1.0)
    early = {"component_early/speed": (0.5,), "component_early/effort": (-0.002,)}
    late = {"component_late/speed": (3.0,), "component_late/effort": (None,)}
    result = replace(RESULT, curves={**RESULT.curves, **early, **late})
    assert reflect(SAMPLE, result, "free", played).splitlines() == [
        *reflect(SAMPLE, RESULT, "free", played).splitlines(),
        "At the end of training, in the first quarter of a full episode, then in the rest (none: no episode lasted so "
        "long): speed 0.50 then 3.00, effort -0.002 then none",
    ]
    assert reflect(SAMPLE, result, "free") == reflect(SAMPLE, RESULT, "free")
    assert reflect(SAMPLE, result, "grammar", played) == reflect(SAMPLE, RESULT, "grammar", played)


@pytest.mark.parametrize("name", ["task_score", "episode_length"])
def test_a_component_that_is_called_as_what_is_measured_is_shown_beside_it(name: str) -> None:
    played = Evaluation(lane="a-s0", fitness=38.0, episode_length=38.0, episodes=64, error=1.0)
    parts = {f"component_early/{name}": (0.5,), f"component_late/{name}": (3.0,)}
    result = replace(RESULT, curves={**RESULT.curves, f"component/{name}": (-7.0,) * 40, **parts})
    usual = reflect(SAMPLE, RESULT, "free", played).splitlines()
    assert reflect(SAMPLE, result, "free", played).splitlines() == [
        *usual[:3],
        f"component {name}: [" + ", ".join(["-7.00"] * 10) + "], Max: -7.00, Mean: -7.00, Min: -7.00",
        *usual[3:],
        "At the end of training, in the first quarter of a full episode, then in the rest (none: no episode lasted so "
        f"long): component {name} 0.50 then 3.00",
    ]


def test_neither_the_own_total_nor_the_human_reward_is_shown() -> None:
    assert not any("human" in line or line.startswith("reward") for line in reflect(SAMPLE, RESULT, "free").split("\n"))


@pytest.mark.parametrize("curve", [(), (None, None), (math.nan, math.inf)])
def test_a_curve_without_a_defined_point_has_no_extremes(curve) -> None:
    (score, length) = summary({"fitness": curve, "episode_length": (1.0,)}, points=10)
    assert score == f"task_score: [{', '.join(['none'] * len(curve))}]"
    assert length == "episode_length: [1.00], Max: 1.00, Mean: 1.00, Min: 1.00"


def test_a_diverged_training_says_so_first() -> None:
    result = replace(RESULT, state=TrainingState.DIVERGED, message="|reward| reached 1e30")
    first = reflect(SAMPLE, result, "grammar").split("\n")[0]
    assert first == "The training was stopped early (|reward| reached 1e30)."


def test_a_failure_of_the_machine_is_not_explained_to_the_model() -> None:
    result = replace(RESULT, state=TrainingState.FAILED, curves={}, message="out of memory on host seven")
    assert "host seven" not in reflect(SAMPLE, result, "free")


def test_a_refusal_lists_its_findings() -> None:
    findings = (
        Finding(rule="unknown-input", message="there is no `vel`", fix="use `velocity`", line=2),
        Finding(rule="random", message="the reward is random"),
    )
    refused = replace(SAMPLE, verdict=Verdict(candidate=CANDIDATE.id, code=VerdictCode.REFUSED, findings=findings))
    assert reflect(refused, None, "free").splitlines() == [
        "The reward function could not be used:",
        "- line 2: there is no `vel` [unknown-input]; use `velocity`",
        "- the reward is random [random]",
    ]
    timeout = replace(SAMPLE, verdict=Verdict(candidate=CANDIDATE.id, code=VerdictCode.TIMEOUT))
    assert reflect(timeout, None, "free").endswith("\n- timeout")
