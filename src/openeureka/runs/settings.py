"""The settings of `eureka run` and `eureka train` as keyword arguments, for editors and type checkers.

They mean what the fields of `config.RunConfig` and `config.TrainConfig` say; a test holds them to those.
"""

from __future__ import annotations

from pathlib import Path
from typing import TypedDict


class _Shared(TypedDict, total=False):
    curriculum: str | Path
    seed: int
    seeds: int
    steps: int | float
    worlds: int
    bonus: str
    device: str
    threads: int
    executor: str
    address: str
    dir: str | Path
    unsafe_no_sandbox: bool


class TrainSettings(_Shared, total=False):
    """All fields of `TrainConfig` but `env` and `reward`."""


class SearchSettings(_Shared, total=False):
    """All fields of `RunConfig` but `env` and `model`."""

    base_url: str
    sample: int
    iteration: int
    search: str
    init: str | Path
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
