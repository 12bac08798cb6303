"""`eureka play`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..config import parse
from ..errors import ConfigError
from ..report.video import render
from .settings import PlayConfig, split


def play(words: Sequence[str]) -> None:
    """Render a policy and say where the video is."""
    settings, _ = split(words)
    config = parse(PlayConfig, settings)
    policy: str | bytes = config.policy
    if policy not in ("random", "zero"):
        policy = _read(Path(config.policy))
    target = Path(config.out or f"{config.env}.mp4")
    target.write_bytes(render(config.env, policy, seconds=config.seconds, seed=config.seed))
    print(f"Wrote {target}")


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ConfigError(f"Cannot read the policy {path}: {error.strerror}.") from None
