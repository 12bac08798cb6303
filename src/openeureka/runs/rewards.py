"""Reads and checks the rewards that a person gives as names, files or texts."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Sequence
from pathlib import Path

from ..config import AS_TRAINED, TrainConfig, TuneConfig, short_name
from ..errors import ConfigError, RewardFileError
from ..method.given import Given
from ..parsing import short_path
from ..reward import extract
from ..reward.weights import weights
from ..sandbox.client import Sandbox
from ..store import artifacts, read_config
from ..tasks import human
from ..tasks.record import record_states
from ..tasks.registry import get
from ..text import one_line, plain
from ..types import OWN_REWARDS, Candidate, Verdict, VerdictCode


def read(program: str | Path) -> Candidate:
    """The program in a file or in a text. Either may be a model's whole reply. Raises RewardFileError for a file that
    cannot be read."""
    return extract.in_text(str(program)) if is_text(program) else extract.in_file(_file(program))[0]


def _file(word: str | Path) -> Path:
    return Path(os.path.expanduser(word))


def is_text(program: str | Path) -> bool:
    """Whether it is a program itself, several lines or one `def`, and not the name of one."""
    return isinstance(program, str) and ("\n" in program or program.startswith("def "))


def listed(words: str) -> list[str]:
    """The names in a text, separated by commas. Commas in the path of an existing file do not separate."""
    names, parts = [], words.split(",")
    while parts:
        joined = (size for size in range(len(parts), 1, -1) if os.path.isfile(_file(",".join(parts[:size]).strip())))
        size = next(joined, 1)
        names.append(",".join(parts[:size]).strip())
        del parts[:size]
    return [name for name in names if name]


def named(config: TrainConfig, words: Sequence[str | Path]) -> Given:
    """Given rewards by name. A file is named after its stem, and after its folder too where two have one stem; a text
    is named after its number. Each reward is checked before anything of a run is made.

    Raises:
        ConfigError: for no reward, or two with one name.
        RewardFileError: for a reward that cannot be read or was refused.
    """
    if not words:
        raise ConfigError("`reward` names nothing to train; write for example reward=human,sparse.")
    names = [_name(word, number) for number, word in enumerate(words, start=1)]
    names = [_in_folder(word, name) if names.count(name) > 1 else name for name, word in zip(names, words, strict=True)]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(
                f"`reward` names `{name}` twice; give the files different names, or name it once, with seeds=2."
            )
    programs = {name: read(word) for name, word in zip(names, words, strict=True) if word not in OWN_REWARDS}
    verdicts = judge(config.env, list(programs.values()), worlds=config.worlds, unsafe=config.unsafe_no_sandbox)
    judged = {name: (programs[name], verdict) for name, verdict in zip(programs, verdicts, strict=True)}
    for name, word in zip(names, words, strict=True):
        if name in judged and not judged[name][1].accepted:
            reasons = "; ".join(explain(judged[name][1]))
            raise RewardFileError(f"{name if is_text(word) else word} was refused: {reasons}")
    return {name: judged.get(name) for name in names}


def to_tune(config: TuneConfig, word: str | Path) -> tuple[Candidate, Verdict]:
    """The reward whose numbers are fitted, checked before anything of a run is made.

    Args:
        word: as the setting `reward`, or a text.

    Raises:
        ConfigError: where there is nothing to fit, or the reward is of a run on another task.
        RewardFileError: for a reward that cannot be read or was refused.
        StoreError: for a folder that is no run.
        TaskError: where the task's own reward is no program.
    """
    name = "the reward" if is_text(word) else f"`{word}`"
    candidate = _only(config, word)
    (verdict,) = judge(config.env, [candidate], worlds=config.worlds, unsafe=config.unsafe_no_sandbox)
    if not verdict.accepted:
        raise RewardFileError(f"{name} was refused: {'; '.join(explain(verdict))}")
    if not weights(candidate.source):
        raise ConfigError(f"There is nothing to tune: {name} has no number that is a weight or a scale.")
    return candidate, verdict


def left_out(config: TuneConfig, word: str | Path) -> str:
    """Where a run's best reward is tuned: sentences about settings and limits of that run that the tuning does not use.
    Empty for any other reward, and where the only differences are settings that were given for the tuning.
    """
    if is_text(word) or not Path(word).is_dir():
        return ""
    run, usual = read_config(Path(word)), TuneConfig()
    own = {
        key: getattr(run, key) for key in AS_TRAINED if getattr(run, key) != getattr(config, key) == getattr(usual, key)
    }
    settings = " ".join(shlex.quote(f"{key}={value}") for key, value in own.items())
    said = [f"{word} trained with other settings. To tune its reward as it trained, add: {settings}"] if own else []
    said += [f"The limits of {word} do not apply here: {run.limits}"] if run.limits else []
    return "\n".join(said)


def _only(config: TuneConfig, word: str | Path) -> Candidate:
    if not str(word):
        raise ConfigError("`reward` names nothing to tune; write for example reward=human.")
    if word == "human":
        way = "name a file: reward=FILE.py, or a run: reward=DIR"
        return Candidate.of(human.program(get(config.env), way))
    if word == "sparse":
        raise ConfigError(
            "The sparse reward of a task is not a program; tune `human`, a file, or the best reward of a run."
        )
    directory = _file(word) if not is_text(word) else None
    if directory is None or not directory.is_dir():
        return read(word)
    env = read_config(directory).env
    if _kind(env) != _kind(config.env):
        raise ConfigError(
            f"{short_path(directory)} is a run of {short_name(env)}; add env={env}, or name its reward file: "
            f"reward={short_path(directory / 'best' / 'reward.py')}."
        )
    program = artifacts.read(directory, "best/reward.py")
    if program is None:
        raise RewardFileError(
            f"There is no program in {short_path(directory)}/best: its best reward came with the task, or nothing has "
            "trained yet. Name a file, or use reward=human."
        )
    return extract.in_text(program.decode(errors="replace"))


def _kind(env: str) -> str:
    """A task's name, without the path of its file and without its settings. Whether a reward fits, the checks tell."""
    return short_name(env.partition("+")[0])


def _name(reward: str | Path, number: int) -> str:
    """The name of a given reward: of a file its stem, without characters that the name of a folder may not have."""
    if reward in OWN_REWARDS:
        return str(reward)
    if is_text(reward):
        return f"reward_{number}"
    stem = _nameable(Path(reward).stem)
    return f"{stem}_file" if stem in OWN_REWARDS else stem


def _in_folder(reward: str | Path, name: str) -> str:
    """The name of a file by its folder and its stem; any other reward keeps its name."""
    if reward in OWN_REWARDS or is_text(reward):
        return name
    return _nameable(f"{Path(reward).absolute().parent.name}_{Path(reward).stem}")


def _nameable(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9_-]+", "_", text).lstrip("-")[:60] or "reward"


def judge(env: str, candidates: Sequence[Candidate], *, worlds: int = 0, unsafe: bool) -> list[Verdict]:
    """Verdicts in the order of the candidates, by the gate and sandbox of a run with this number of worlds."""
    if not candidates:
        return []
    task = get(env)
    with Sandbox(task.spec, record_states(env), worlds=worlds or task.recipe.worlds, unsafe=unsafe) as sandbox:
        return [sandbox.check(candidate) for candidate in candidates]


_MEANINGS = {
    VerdictCode.ACCEPTED: "it can train",
    VerdictCode.NO_PROGRAM: "there is no reward function in it",
    VerdictCode.REFUSED: "it uses something that is not allowed in a reward; it was not run",
    VerdictCode.CONTRACT: "it was run on states of the task, and did not do what a reward must do",
    VerdictCode.TIMEOUT: "it was run on states of the task, and took too long",
    VerdictCode.CRASHED: "it was run on states of the task, and crashed its process",
    VerdictCode.SCREENED: "it can train, but others were preferred",
}


def meaning(verdict: Verdict) -> str:
    """What a verdict means, for people; its findings say why."""
    if any(finding.rule == "syntax" for finding in verdict.findings):
        return "Python cannot read it; it was not run"
    return _MEANINGS[verdict.code]


def explain(verdict: Verdict, source: str = "") -> list[str]:
    """The verdict for a person: a line for each finding, or one that says what the program computes.

    Args:
        source: the program, to show a line that Python cannot read.
    """
    if verdict.graph is None:
        lines = source.splitlines()
        told = []
        for finding in verdict.findings:
            told.append(plain(finding.sentence()))
            if finding.rule == "syntax" and finding.line is not None and finding.line <= len(lines):
                told.append(f"    {one_line(lines[finding.line - 1])}")
        return told
    names = ", ".join(plain(name) for name, _ in verdict.graph.components) or "none"
    return [f"{len(verdict.graph.nodes)} tensor operations; components: {names}; {verdict.seconds * 1000:.0f} ms"]
