"""The flag of suspected reward hacking, wherever a person looks at a run."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from openeureka.cli.show import summary
from openeureka.report import html
from openeureka.report.view import RunView
from openeureka.types import Evaluation

from . import search
from .page import words


def judged(concentration: float) -> RunView:
    """A finished run whose best policy was tried in a changed world. F rests on few moments by `concentration`."""
    run = search.finished()
    scores = {
        lane: dataclasses.replace(e, error=0.5, concentration=concentration) for lane, e in run.evaluations.items()
    }
    kept = next(lane for lane in scores if lane.endswith("-s2"))
    heavier = Evaluation(lane=kept, fitness=40.0, episode_length=9.0, episodes=4, error=0.25)
    tried = {"mass +10 %": heavier, "untrained": dataclasses.replace(heavier, fitness=1.0)}
    return dataclasses.replace(run, evaluations=scores, tryouts={kept: tried})


def test_a_sign_is_flagged_on_the_page_in_the_file_and_in_the_terminal(tmp_path: Path) -> None:
    run = judged(0.8)
    sentence = "In 2 of 2 trainings; the first: over 4 held-out episodes, the highest twentieth of what counts for F"
    assert "⚑ suspected reward hacking" in html.report(run, tmp_path) and sentence in html.report(run, tmp_path)
    assert f"| F rests on few moments | SUSPECTED | {sentence}" in words(html.report(run, tmp_path))
    assert any(line.startswith("Suspected reward hacking: F rests on few moments.") for line in summary(run))


def test_a_reward_without_signs_says_what_was_looked_for(tmp_path: Path) -> None:
    run = judged(0.06)
    assert "suspected reward hacking" not in html.report(run, tmp_path)
    report = words(html.report(run, tmp_path))
    assert report.count("| not seen |") == 3 and "SUSPECTED" not in report
    # The best policy's own held-out F is 50 - 2.
    assert "| unchanged | 48.00 ± 0.50 |" in report and "| mass +10 % | 40.00 ± 0.25 |" in report
    assert "| untrained |" not in report  # that is no other world
    assert "so its F is above their mean. ± here: standard error over episodes." in report
    assert not any("hacking" in line for line in summary(run))


def test_where_a_task_has_no_other_world_none_was_looked_at(tmp_path: Path) -> None:
    run = judged(0.06)
    unplayed = {
        lane: {name: dataclasses.replace(score, fitness=None, episodes=0) for name, score in tried.items()}
        for lane, tried in run.tryouts.items()
    }
    report = words(html.report(dataclasses.replace(run, tryouts=unplayed), tmp_path))
    assert report.count("| not seen |") == 2 and "| not checked |" in report
    assert "| unchanged |" not in report


def test_where_no_untrained_policy_played_what_was_learnt_is_not_known(tmp_path: Path) -> None:
    """As in runs of an older version."""
    run = judged(0.06)
    older = {lane: {"mass +10 %": tried["mass +10 %"]} for lane, tried in run.tryouts.items()}
    report = words(html.report(dataclasses.replace(run, tryouts=older), tmp_path))
    assert report.count("| not seen |") == 2 and "| fails in a slightly changed world | not checked |" in report
    assert "| mass +10 % | 40.00 ± 0.25 |" in report


def test_a_run_that_was_never_tried_says_nothing(tmp_path: Path) -> None:
    assert "hacking" not in html.report(search.finished(), tmp_path)


def test_broken_physics_is_told_where_it_was_seen(tmp_path: Path) -> None:
    run = judged(0.06)
    assert "breaks the physics" not in words(html.report(run, tmp_path)), "the run counted no broken episodes"
    broken = {lane: dataclasses.replace(score, lost=12) for lane, score in run.evaluations.items()}
    run = dataclasses.replace(run, evaluations=broken)
    assert "| breaks the physics | SUSPECTED | In 2 of 2 trainings" in words(html.report(run, tmp_path))
    assert any(line.startswith("Suspected reward hacking: breaks the physics.") for line in summary(run))
