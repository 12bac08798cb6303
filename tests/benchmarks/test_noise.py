"""Play with and without noise: what the table counts."""

from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture
def noise(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    import noise  # pyright: ignore[reportMissingImports]

    return noise


def test_a_policy_that_fails_in_its_one_episode_and_succeeds_with_noise_is_counted(noise: ModuleType):
    played = {"a": [0.0, 0.9], "b": [0.0, 0.5], "c": [1.0, 1.0], "d": [None, 1.0]}
    (row,) = noise.rows({"shadow_hand_pen": {"alike": True, "played": played}})
    assert row == ("shadow_hand_pen", "alike", "3", "0.3333", "0.8", "0.87", "1")


def test_doors_begin_alike_and_cartpole_does_not(noise: ModuleType):
    assert noise.alike("shadow_hand_door_open_outward") and not noise.alike("cartpole")
