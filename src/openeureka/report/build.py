"""Writes what a person opens after a run. All of it is made from the store and can be made again."""

from __future__ import annotations

from pathlib import Path

from ..errors import RewardFileError
from ..store import artifacts
from ..training.policy import Policy
from . import events, export, filming, html, markdown, plots, video
from .view import VIDEO, RunView


def build(directory: Path, wanted: str = "") -> list[str]:
    """Write best/policy.onnx, the videos that are missing, TensorBoard events, summary.png, report.md and report.html.

    Args:
        wanted: videos of `all` policies, the `best` or `none`; empty means what the run began with.

    Returns:
        Sentences that say what could not be made, and why.

    Raises:
        StoreError: when the directory holds no run or cannot be written.
    """
    run = RunView.read(directory)
    problems = [best(directory, wanted or run.config.video), _candidates(directory, run, wanted or run.config.video)]
    run = RunView.read(directory)  # now with videos
    for job, result in run.results.items():
        artifacts.write(directory / "lanes" / job / events.FILE_NAME, events.of(result))
    artifacts.write(directory / "summary.png", plots.summary(run))
    artifacts.write(directory / "report.md", markdown.report(run))
    artifacts.write(directory / "report.html", html.report(run, directory))
    return list(dict.fromkeys(problem for problem in problems if problem))


def best(directory: Path, wanted: str) -> str:
    """Make the files of the best policy, which is there as soon as anything has trained.

    Returns:
        Why one of them could not be made, as a sentence, or an empty string.
    """
    source = directory / "best" / "policy.safetensors"
    if not source.exists():
        return ""
    try:
        policy = Policy.from_bytes(source.read_bytes())
        artifacts.write(directory / "best" / "policy.onnx", export.to_onnx(policy))
        picture = directory / "best" / VIDEO
        if wanted != "none" and not picture.exists():
            artifacts.write(picture, video.render(policy.env, source.read_bytes()))
    except (RewardFileError, video.VideoUnavailable) as error:
        return str(error)
    return ""


def _candidates(directory: Path, run: RunView, wanted: str) -> str:
    if wanted != "all":
        return ""
    return filming.film(directory, run.config.env, filming.missing(directory, run.config).items())
