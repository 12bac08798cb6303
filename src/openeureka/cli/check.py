"""`eureka check`."""

from __future__ import annotations

from collections.abc import Sequence

from ..config import parse
from ..reward.files import read
from .rewards import explain, judge
from .settings import CheckConfig, only_path, split


def check(words: Sequence[str]) -> int:
    """Print the verdict on one reward file; returns 1 when it was refused."""
    settings, paths = split(words)
    config = parse(CheckConfig, settings)
    path = only_path(paths, "eureka check env=cartpole my_reward.py")
    (verdict,) = judge(config.env, [read(path)], unsafe=config.unsafe_no_sandbox)
    print("\n".join((f"{path}: {verdict.code}", *explain(verdict))))
    return 0 if verdict.accepted else 1
