"""Writes what a person opens after a run. All of it is made from the store and can be made again."""

from __future__ import annotations

from pathlib import Path

from ..store import artifacts
from . import events, html, markdown, plots, video
from .view import RunView


def build(directory: Path, *, with_video: bool = True) -> str:
    """Write best/video.mp4, TensorBoard events, summary.png, report.md and report.html.

    Returns:
        Why there is no video, as a sentence; empty when there is one or none was wanted.

    Raises:
        StoreError: when the directory holds no run or cannot be written.
    """
    run = RunView.read(directory)
    problem = _video(directory, run.config.env) if with_video else ""
    run = RunView.read(directory)
    for job, result in run.results.items():
        artifacts.write(directory / "lanes" / job / events.FILE_NAME, events.encode(result.curves))
    artifacts.write(directory / "summary.png", plots.summary(run))
    artifacts.write(directory / "report.md", markdown.report(run))
    artifacts.write(directory / "report.html", html.report(run, directory))
    return problem


def _video(directory: Path, env: str) -> str:
    """A policy is there once the final trainings are done."""
    policy = directory / "best" / "policy.safetensors"
    if not policy.exists():
        return ""
    try:
        artifacts.write(directory / "best" / "video.mp4", video.render(env, policy.read_bytes()))
    except video.VideoUnavailable as error:
        return str(error)
    return ""
