"""`eureka play`."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from ..config import parse, short_name
from ..errors import ConfigError
from ..report import viewer
from ..report.stage import Stage
from ..report.video import render
from ..store import artifacts
from ..training.policy import Policy
from .progress import working
from .settings import PlayConfig, only_path, split

AGENTS = ("random", "zero")


def play(words: Sequence[str], *, web: bool = False) -> None:
    """Show a policy in a window or a browser; without a display, or with `out=`, write a video and say where it is."""
    settings, paths = split(words)
    config = parse(PlayConfig, settings)
    in_window = not web and not config.out and viewer.has_display()
    if paths:
        directory = only_path(paths, "eureka play DIR")
        video = str(directory / "play.mp4")  # not best/video.mp4, which belongs to the report
        policy = str(directory / "best" / "policy.safetensors")
        config = dataclasses.replace(config, policy=config.policy or policy, out=config.out or video)
    if config.policy in AGENTS:
        policy = config.policy
        env = config.env or "cartpole"
    else:
        policy = _read(Path(config.policy))
        env = _env_of(policy, config.env)
    if web:
        from ..report.page import page  # loads a user interface

        page(Stage(env, policy, config.seed), config.port)
        return
    if in_window:
        viewer.window(Stage(env, policy, config.seed))
        return
    target = Path(config.out or f"{short_name(env)}.mp4")
    with working(f"Filming {config.seconds:g} s"):
        video = render(env, policy, seconds=config.seconds, seed=config.seed)
    artifacts.write(target, video)
    print(f"Wrote {target}")


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ConfigError(
            f"Cannot read the policy {path}: {error.strerror}; name a run directory or policy=FILE, random or zero."
        ) from None


def _env_of(policy: bytes, wanted: str) -> str:
    """The task a policy was trained on; it fits no other. `wanted` may say where its file lies now."""
    trained = Policy.from_bytes(policy).env
    if wanted and short_name(wanted) != short_name(trained):
        raise ConfigError(f"The policy was trained on env={trained}, not on env={wanted}; leave env= out.")
    return wanted or trained
