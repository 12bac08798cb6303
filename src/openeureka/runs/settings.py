"""What Python programs may set, for type checkers. Each key means what the field of that name in `config` means.

wanted: openeureka.SearchSettings = {"sample": 8, "steps": 1e6}
run = openeureka.search("ant", **wanted)
"""

from __future__ import annotations

from pathlib import Path
from typing import TypedDict


class _Shared(TypedDict, total=False):
    python: str | Path
    curriculum: str | Path
    randomise: str | Path
    observe: str
    seed: int
    seeds: int
    steps: int | float
    worlds: int
    bonus: str
    device: str
    threads: int
    executor: str
    address: str
    log: str
    dir: str | Path
    unsafe_no_sandbox: bool


class TrainSettings(_Shared, total=False):
    """All fields of `TrainConfig` but `env` and `reward`, and `python`."""


class TuneSettings(_Shared, total=False):
    """All fields of `TuneConfig` but `env` and `reward`, and `python`."""

    trials: int
    sample: int


class RobustSettings(TypedDict, total=False):
    """All fields of `RobustConfig` but `model`."""

    base_url: str
    sample: int
    repair: int
    start: str
    steps: int | float
    device: str
    threads: int
    max_cost: float
    price: str


class SearchSettings(_Shared, total=False):
    """All fields of `RunConfig` but `env` and `model`, and `python`."""

    base_url: str
    sample: int
    iteration: int
    search: str
    screen: int
    schedule: str
    init: str | Path
    safety: str
    limits: str
    feedback: str
    feedback_timeout: float
    judge: str
    repair: int
    refill: int
    temperature: float
    max_cost: float
    price: str
    baselines: str
    video: str
    tune: int
    polish: int
    polish_steps: int | float
