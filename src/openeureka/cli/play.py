"""`eureka play`: a policy in a window, in a browser, or as a video."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..config import short_name
from ..display.progress import working
from ..errors import ConfigError, RewardFileError
from ..film import viewer
from ..film.stage import Stage, draws_itself
from ..film.video import render
from ..parsing import command_line, parse
from ..report import filming
from ..runs import trust
from ..store import Store, artifacts, expect_files, is_run, read_config
from ..text import one_line
from ..training.policy import Policy
from .settings import PlayConfig, only_path, split

AGENTS = ("random", "zero")
_MADE_BY = {
    "polished": "`polish=N` leaves one if it finds a better policy",
    "robust": "`eureka robust` leaves one",
}
"""Policies of a run besides that in `best/`: what `policy=` calls each, and where it comes from."""
HUMAN = "human"
CAPTION = 40
"""Characters that half a picture has room for."""


def play(words: Sequence[str], *, web: bool = False) -> None:
    """Show a policy in a window or a browser; without a display, with `out=`, or of an environment that draws itself,
    write a video and say where it is."""
    settings, paths = split(words)
    config = parse(PlayConfig, settings)
    directory = only_path(paths, "eureka play DIR") if paths else None
    env, policy = _chosen(config, directory)
    if web and draws_itself(env):
        raise ConfigError(f"`{env}` draws its own pictures, so --web cannot show it in 3-D; leave --web out.")
    film = not web and bool(config.out or config.beside or draws_itself(env) or not viewer.has_display())
    if web and (config.out or config.beside):
        raise ConfigError("out= and beside= are for a video; leave --web out, or leave them out.")
    if not web and config.port:
        raise ConfigError("port= works only with --web; add --web, or leave port= out.")
    if not film and any(word.startswith("seconds=") for word in settings):
        raise ConfigError("seconds= is the length of a video; add out=FILE.mp4, or leave seconds= out.")
    if web:
        from ..film.web import page  # loads a user interface

        page(Stage(env, policy, config.seed), config.port)
    elif film:
        _film(env, policy, config, directory)
    else:
        viewer.window(Stage(env, policy, config.seed))


def _chosen(config: PlayConfig, directory: Path | None) -> tuple[str, bytes | str]:
    """What to play: the environment, and a policy file or the name of an agent."""
    agent = config.policy in AGENTS
    if agent and directory is not None:
        return _trusted(read_config(directory).env, config.env), config.policy
    if agent and config.env:
        return config.env, config.policy
    if directory is not None and config.policy in ("", *_MADE_BY):
        policy, trained = _of_run(directory, config.policy)
    elif config.policy and not agent:
        policy, trained = _read(Path(config.policy))
    else:
        raise ConfigError("Name what to play: a run directory, policy=FILE, or env=NAME policy=random.")
    return _env_of(trained, config.env), policy


def _film(env: str, policy: bytes | str, config: PlayConfig, directory: Path | None) -> None:
    """Write a video, into the run's directory unless `out=` names another place."""
    target = Path(config.out or f"{short_name(env)}.mp4")
    if target.suffix != ".mp4" or target.is_dir():
        raise ConfigError(f"Videos are MP4 files: out={config.out:.80} must end in .mp4, and be no folder.")
    folder, name = (directory, "play.mp4") if directory and not config.out else (target.parent, target.name)
    artifacts.expect_writable(folder)
    beside = _beside(directory, config.beside)
    captions = tuple(map(_caption, (config.policy or "best reward", config.beside))) if beside is not None else ()
    with working(f"Filming {config.seconds:g} s"):
        video = render(env, policy, beside=beside, captions=captions, seconds=config.seconds, seed=config.seed)
    artifacts.write(folder, name, video)
    print(f"Wrote {folder / name}")


def _of_run(directory: Path, wanted: str) -> tuple[bytes, str]:
    """A policy of a run or a training, and its task. Anybody may have made the directory."""
    policy = artifacts.read(directory, f"{wanted or 'best'}/policy.safetensors")
    if policy is not None:
        return policy, Policy.from_bytes(policy).env
    with Store.view(directory) as store:  # refuses what is no run
        expect_files(store)
    if wanted:
        raise ConfigError(f"{directory} has no {wanted} policy: {_MADE_BY[wanted]}. Leave policy={wanted} out.")
    raise ConfigError(f"{directory} has no policy yet; `{command_line('show', directory)}` shows how far it is.")


def _beside(directory: Path | None, wanted: str) -> bytes | str | None:
    """The other policy of a film."""
    if not wanted:
        return None
    if wanted in AGENTS:
        return wanted
    if wanted != HUMAN and not Path(wanted).exists():
        raise ConfigError(f"There is no policy file {wanted}; beside= takes human, random, zero or a policy file.")
    if wanted != HUMAN:
        return _read(Path(wanted))[0]
    policy = filming.human(directory) if directory is not None and is_run(directory) else None
    if policy is None:
        raise ConfigError(
            "beside=human needs a run that trained the human reward: name its directory, or a policy file."
        )
    return policy


def _caption(said: str) -> str:
    return f"{HUMAN} reward" if said == HUMAN else one_line(Path(said).parent.name or said, CAPTION)


def _read(path: Path) -> tuple[bytes, str]:
    """A policy file, and its task."""
    try:
        data = path.read_bytes()
        return data, Policy.from_bytes(data).env
    except RewardFileError as error:
        raise RewardFileError(f"{path}: {error}") from None
    except OSError as error:
        raise ConfigError(
            f"Cannot read the policy {path}: {error.strerror}; name a run directory, policy=FILE, or env=NAME "
            "policy=random."
        ) from None


def _env_of(trained: str, wanted: str) -> str:
    """The task a policy was trained on; it fits no other. `wanted` may say where its file lies now."""
    if wanted and short_name(wanted) != short_name(trained):
        raise ConfigError(f"The policy was trained on env={trained}, not on env={wanted}; leave env= out.")
    return _trusted(trained, wanted, "The policy")


def _trusted(named: str, wanted: str, who: str = "The run") -> str:
    """The task that is wanted, else the one that a file names. As the file may come from anybody, its task must be
    installed, or have been typed on this machine before."""
    if not wanted:
        trust.expect_known(named, who, "add that env= to the command")
    return wanted or named
