"""Writes what a person opens after a run. All of it is made from the store and can be made again."""

from __future__ import annotations

from pathlib import Path

from ..errors import RewardFileError, TaskError
from ..film import video
from ..parsing import command_line
from ..store import artifacts, read_config
from ..tasks import registry
from ..tasks.task import Task
from ..training.policy import Policy
from . import export, filming, html, tensorboard
from .view import FOLDERS, VIDEO, RunView


def build(directory: Path, wanted: str = "", env: str = "") -> list[str]:
    """Write the policy files of best/, polished/ and robust/, missing videos, TensorBoard events and report.html.

    Args:
        wanted: videos of `all` policies, the `best` or `none`; empty means what the run began with.
        env: the run's task, as a person typed it. Without it only an installed task is imported, and no file that the
            settings name. What a policy names as its task is never imported.

    Returns:
        Sentences that say what could not be made, and why.

    Raises:
        StoreError: when the directory holds no run or cannot be written.
    """
    config = read_config(directory)
    wanted = wanted or config.video
    env = env or (config.env if registry.installed(config.env) else "")
    problems = [policy_files(directory, folder, wanted, env) for folder in FOLDERS]
    problems.append(_lane_videos(directory, wanted, env))
    run = RunView.read(directory)  # after the videos are made: it says which there are
    for lane, result in run.results.items():
        artifacts.write(directory, f"lanes/{lane}/{tensorboard.EVENTS}", tensorboard.events_of(result))
    artifacts.write(directory, "report.html", html.report(run, directory))
    return list(dict.fromkeys(problem for problem in problems if problem))


def policy_files(directory: Path, folder: str, wanted: str, env: str) -> str:
    """Make the files of the policy in a folder, if it holds one: `best` does as soon as anything has trained.

    Args:
        env: task that it is filmed on; empty means that none may be imported.

    Returns:
        Why one of them could not be made, as a sentence, or an empty string.
    """
    data = artifacts.read(directory, f"{folder}/policy.safetensors")
    if data is None:
        return ""
    if not env:
        return _not_imported(directory)
    try:
        problem = _programs(directory, folder, Policy.from_bytes(data), registry.get(env))
        if wanted == "none" or artifacts.exists(directory, f"{folder}/{VIDEO}"):
            return problem
        other = filming.human(directory) if folder == "best" else None
        captions = ("the best reward", "the human reward") if other is not None else ()
        film = video.render(env, data, beside=other, captions=captions)
        if artifacts.read(directory, f"{folder}/policy.safetensors") == data:  # a search at work may replace it
            artifacts.write(directory, f"{folder}/{VIDEO}", film)
    except (RewardFileError, TaskError, video.VideoUnavailable) as error:
        return str(error)
    return problem


def _programs(directory: Path, folder: str, policy: Policy, task: type[Task]) -> str:
    """Write the files that run a policy elsewhere, and delete those that no longer belong to it.

    Returns:
        Why some are missing, or stay as they were, as a sentence, or an empty string.
    """
    problem = ""
    try:
        files = export.deployed(policy, task)
    except export.NotRenewed as error:
        return str(error)
    except TaskError as error:
        clip, problem = {"observation_clip": task.clip_observations}, str(error)
        files = {"policy.onnx": export.to_onnx(policy, clip)}
    found = artifacts.names(directory, f"{folder}/{export.ASSETS}")
    # Other files in assets/ are a person's own.
    numbered = (f"{export.ASSETS}/{name}" for name in found if name.partition("_")[0].isdigit())
    for name in {*export.PROGRAMS, *numbered} - files.keys():
        artifacts.remove(directory, f"{folder}/{name}")
    for name, content in files.items():
        artifacts.write(directory, f"{folder}/{name}", content)
    return problem


def _lane_videos(directory: Path, wanted: str, env: str) -> str:
    missing = filming.missing(directory) if wanted == "all" else {}
    if missing and not env:
        return _not_imported(directory)
    return filming.film(directory, env, missing.items())


def _not_imported(directory: Path) -> str:
    return (
        "No video and no new policy.onnx: the run's task is not installed, and code that a run names is not imported "
        f"unless you name it too. Add env=FILE.py to `{command_line('report', directory)}`."
    )
