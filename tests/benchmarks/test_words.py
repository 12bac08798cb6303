"""Marks go to the policy whose film they were given for, and a row compares the policies with and without the words."""

from pathlib import Path
from typing import Any

import pytest
import torch
import words
from safetensors.torch import save

from openeureka.reward import extract
from openeureka.types import Episodes


@pytest.fixture
def key(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    path = tmp_path / "key.json"
    monkeypatch.setattr(words, "KEY", path)
    return path


def policy(**measures: float) -> dict[str, Any]:
    return {"fitness": 1.0, "tilt": 9.0, "bounce": 4.0, "contact_force": 200.0, "falls": 0.5, **measures}


def test_marks_are_given_to_the_policies_behind_the_films(key: Path):
    words.write(key, {"00": ["words", 1], "01": ["reflection", 0], "02": ["words", 0], "03": ["reflection", 1]})
    known = {"groups": {group: [policy(), policy()] for group in words.GROUPS}}
    for marks in ({"00": 8, "01": 1, "02": 6, "03": 3}, {"00": 10, "01": 2, "02": 7, "03": 2}):
        known = words.judge(known, marks)
    assert words.values(known["groups"]["words"], "judged") == [6.5, 9]
    assert words.values(known["groups"]["reflection"], "judged") == [1.5, 2.5]
    with pytest.raises(SystemExit, match="00, 01, 02, 03"):
        words.judge(known, {"00": 3})


def test_without_films_it_is_said_how_to_make_them(key: Path):
    for asks in (words.picture, lambda: words.judge({}, {"00": 3})):
        with pytest.raises(SystemExit, match=r"has no films: move benchmarks/results/words.json away"):
            asks()


def test_a_row_is_with_the_words_less_without():
    groups = {"words": [policy(tilt=2.0), policy(tilt=4.0)], "reflection": [policy(tilt=9.0), policy(tilt=11.0)]}
    rows = {row[0]: row[1:] for row in words.rows({"groups": groups})}
    without, told, apart = rows["tilt of the torso [degrees]"]
    assert without.startswith("10.0 ") and told.startswith("3.0 ") and apart.startswith("-7 (")
    assert words.MEASURES["judged"] not in rows  # nobody has judged yet


def test_a_level_torso_of_steady_height_has_no_tilt_and_no_bounce():
    states = {"up_proj": torch.tensor([1.0, 1.0, 0.5, 0.5]), "torso_height": torch.tensor([0.5, 0.5, 0.4, 0.6])}
    level, tilted = (
        words.gait(
            Episodes(fitness=(1.0,), steps=(2,), owners=(0, 0), states=save({k: v[part] for k, v in states.items()}))
        )
        for part in (slice(2), slice(2, 4))
    )
    assert level == pytest.approx({"tilt": 0.0, "bounce": 0.0}, abs=0.1)
    assert tilted == pytest.approx({"tilt": 60.0, "bounce": 100 * 0.2 / 2**0.5}, rel=1e-3)


def test_both_groups_have_eight_programs():
    for group in words.GROUPS:
        assert len([text for text in words.claims.asked(words.ENV, group) if extract.program(text)]) == 8
