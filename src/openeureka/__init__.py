"""A language model writes reward functions. Policies train under them and show which one works.

This module offers what Python programs call. Errors are imported at once, everything else on first use.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from .errors import (
    BudgetError,
    CapacityError,
    ConfigError,
    EurekaError,
    FeedbackError,
    ModelError,
    RewardFileError,
    SandboxUnavailable,
    StoreError,
    TaskError,
    WorkerError,
)
from .version import __version__

if TYPE_CHECKING:
    from .benchmark.bench import Bench, bench
    from .benchmark.plan import Plan
    from .events import Asked, Began, Checked, Played, Replied
    from .runs.api import check, open_run, robust, search, searching, train, tune
    from .runs.program import Event, Started
    from .runs.run import LaneView, Run, TrainedPolicy
    from .runs.settings import RobustSettings, SearchSettings, TrainSettings, TuneSettings
    from .score import Outcome
    from .types import Generation, TrainingProgress, TrainingResult, Verdict

__all__ = [
    "Asked",
    "Began",
    "Bench",
    "BudgetError",
    "CapacityError",
    "Checked",
    "ConfigError",
    "EurekaError",
    "Event",
    "FeedbackError",
    "Generation",
    "LaneView",
    "ModelError",
    "Outcome",
    "Plan",
    "Played",
    "Replied",
    "RewardFileError",
    "RobustSettings",
    "Run",
    "SandboxUnavailable",
    "SearchSettings",
    "Started",
    "StoreError",
    "TaskError",
    "TrainSettings",
    "TrainedPolicy",
    "TrainingProgress",
    "TrainingResult",
    "TuneSettings",
    "Verdict",
    "WorkerError",
    "__version__",
    "bench",
    "check",
    "open_run",
    "robust",
    "search",
    "searching",
    "train",
    "tune",
]

_MODULES = {
    "benchmark.bench": ("Bench", "bench"),
    "benchmark.plan": ("Plan",),
    "events": ("Asked", "Began", "Checked", "Played", "Replied"),
    "runs.api": ("check", "open_run", "robust", "search", "searching", "train", "tune"),
    "runs.program": ("Event", "Started"),
    "runs.run": ("LaneView", "Run", "TrainedPolicy"),
    "runs.settings": ("RobustSettings", "SearchSettings", "TrainSettings", "TuneSettings"),
    "score": ("Outcome",),
    "types": ("Generation", "TrainingProgress", "TrainingResult", "Verdict"),
}
_PLACES = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> object:
    """Import a name on first use: torch, MuJoCo and the rest take seconds to load, and many callers need none."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(importlib.import_module(f".{_PLACES[name]}", __name__), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
