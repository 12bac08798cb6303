import errno
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from toys import eureka as run

from openeureka import __version__
from openeureka.cli import main as command
from openeureka.config import FREE_TO_CHANGE
from openeureka.errors import ModelError

COMMANDS = sorted(info.callback.__name__ for info in command.app.registered_commands if info.callback)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_every_command_shows_an_example_of_itself(name, capsys):
    assert run(name, "--help") == 0
    assert f"Example: eureka {name}" in capsys.readouterr().out


def test_the_list_of_commands_has_a_whole_sentence_a_line_at_80_columns(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    assert run("--help") == 0
    lines = capsys.readouterr().out.split("Commands:\n")[1].splitlines()
    assert sorted(line.split()[0] for line in lines) == COMMANDS
    assert not [line for line in lines if len(line) > 80 or not line.endswith(".") or line.endswith("...")]


def test_the_help_of_resume_names_the_settings_that_may_change(capsys):
    run("resume", "--help")
    help_ = " ".join(capsys.readouterr().out.split())
    named = help_.split("may differ from before: ")[1].rstrip(".").split(", ")
    assert {*named, "dir"} == set(FREE_TO_CHANGE) and "max_cost" in named


def test_the_help_of_export_says_which_runs_it_is_for(capsys):
    run("export", "--help")
    assert "a gym:, mjlab: or isaaclab: run" in " ".join(capsys.readouterr().out.split())


def test_help_and_a_typing_error_import_nothing_slow():
    code = (
        "import sys\n"
        "from openeureka.cli.main import main\n"
        "for words in (['--help'], ['run', 'enf=ant'], ['train', 'enf=ant'], ['tune', 'enf=ant']):\n"
        "    try: main(words)\n"
        "    except SystemExit: print('loaded', sorted({'torch', 'mujoco', 'openai'} & set(sys.modules)))"
    )
    output = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert output.count("loaded []\n") == 4, output


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("context", "env=cartpol"), "There is no environment `cartpol`. Did you mean `cartpole`?"),
        (("context", "env=CARTPOLE"), "There is no environment `CARTPOLE`. Did you mean `cartpole`?"),
        (("ui", "host="), "`host` names no address; leave it out"),
        (("context", "enf=cartpole"), "Unknown setting `enf`. Did you mean `env`?"),
        (
            ("run", "env=dmc:cheetah-run", "pyhton=/x"),
            "Unknown setting `pyhton`. Did you mean `python`? `--help` lists all settings.",
        ),
        (("play", "zzz=1"), "Unknown setting `zzz`. Settings: env, "),
        (("run", "python=/x"), "`python=` names the Python in which the environment is installed; add env=."),
        (("play", "env=cartpole", "policy=absent.safetensors"), "Cannot read the policy absent.safetensors"),
        (("play", "env=cartpole", "seconds=0"), "`seconds` must be above 0"),
        (("run", "--env", "cartpole"), "Settings are written without dashes: `env=cartpole`, not `--env`."),
        (("run", "--max-cost=5"), "Settings are written without dashes: `max_cost=5`, not `--max-cost=5`."),
        (("run", "env=robots/cheetah.xml"), "robots/cheetah.xml is a robot, not a task: draft a task with `eureka new"),
        (("run", "model=rnadom"), "There is no model `rnadom`. Did you mean `random`?"),
        (
            ("run", "model=m", "base_url=localhost:8000/v1"),
            "`base_url` must begin with http:// or https://: write base_url",
        ),
        (("run", "base_url=http://localhost:8000/v1"), "model=local does not use base_url=. Leave base_url= out"),
        (("run", "model=random", "init=absent.py"), "Cannot read the reward file "),
        (("check", "reward=mine.py"), "Name the file without reward=, for example: eureka check env=cartpole my_"),
        (("train", "mine.py"), "`mine.py` is not of the form key=value, for example reward=mine.py."),
        (("export", "absent", "to=foo"), "`to` must be one of gymnasium, mjlab, isaaclab, not `foo`."),
        (("run", "model=random", "device=tpu"), "There is no device `tpu`"),
        (("run", "model=random", "env=anymal", "curriculum=no"), "`anymal` has no curriculum"),
        (("run", "model="), "`model` is empty"),
        (("run", "model=local:hub:owner/file.gguf"), "`owner/file.gguf` does not name a file of a model hub; write"),
        (("run", "model=random", "price=1,2"), "model=random does not use price=. Leave price= out"),
        (("run", "model=random", "feedback_timeout=60"), "`feedback_timeout` works only with feedback=human; add"),
        (
            ("run", "model=random", "iteration=1", "feedback=human"),
            "feedback=human is read between generations, but this search has one; use",
        ),
        (
            ("run", "feedback=human", "judge=votes", "tune=8"),
            "`tune` picks by F, against judge=votes; leave it out, or",
        ),
        (("run", "model=random", "iteration=1", "screen=3"), "`screen` judges by an earlier generation, but this"),
        (("run", "model=random", "address=auto"), "`address=` names a Ray cluster; add executor=ray"),
        (("ui", "absent"), "There is no folder absent"),
    ],
)
def test_a_mistake_is_one_sentence_and_exit_code_2_and_leaves_no_folder(words, sentence, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("OPENAI_BASE_URL", raising=False)
    assert run(*words) == 2
    assert not list(tmp_path.iterdir())
    streams = capsys.readouterr()
    assert streams.err.startswith(sentence)
    assert len(streams.err.splitlines()) == 1


def fail_with(error: BaseException, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: object) -> None:
        raise error

    monkeypatch.setattr("openeureka.cli.tasks.context", fail)


def test_an_error_of_ours_sets_its_own_exit_code_and_prints_no_escapes(monkeypatch, capsys):
    fail_with(ModelError("The endpoint said: \x1b[2Jno."), monkeypatch)
    assert run("context") == 3
    assert capsys.readouterr().err == "The endpoint said: no.\n"


@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EROFS, errno.ENAMETOOLONG])
def test_a_place_that_cannot_be_used_is_one_sentence(monkeypatch, capsys, error):
    fail_with(OSError(error, os.strerror(error), "outputs/x"), monkeypatch)
    assert run("context") == 5
    assert capsys.readouterr().err.startswith(f"Cannot use outputs/x: {os.strerror(error)}.")


@pytest.mark.parametrize("error", [errno.EAGAIN, errno.EMFILE, errno.ENFILE, errno.ENOMEM])
def test_a_machine_that_gives_nothing_more_is_one_sentence(monkeypatch, capsys, error):
    fail_with(OSError(error, os.strerror(error)), monkeypatch)
    assert run("context") == 5
    assert f"out of processes, open files or memory ({os.strerror(error)}): raise `ulimit" in capsys.readouterr().err


def test_a_directory_whose_name_no_disk_takes_is_one_sentence(capsys):
    assert run("show", "x" * 300) == 5
    assert capsys.readouterr().err.startswith(f"Cannot use {'x' * 300}")


@pytest.mark.parametrize("before", [(), ("--",)])
@pytest.mark.parametrize("said", ["- keep the torso upright", "--faster", "-5 is too low", "--max-cost=5", "-x"])
def test_what_is_said_to_a_run_may_begin_with_a_dash(monkeypatch, before, said):
    heard = []
    monkeypatch.setattr("openeureka.cli.remote.feedback", lambda directory, words: heard.append((directory, words)))
    assert run("feedback", "outputs/walk", *before, said, "go") == 0
    assert heard == [(Path("outputs/walk"), [said, "go"])]


def test_help_is_shown_beside_a_run_too(capsys):
    assert run("feedback", "outputs/walk", "--help") == 0
    assert "Example: eureka feedback" in capsys.readouterr().out


@pytest.mark.parametrize("module", ["openeureka.cli.tasks", "openeureka.film.viewer", "openeureka.tasks.anatomy"])
def test_an_opengl_that_is_not_here_ends_nothing_that_draws_nothing(module):
    code = f"import {module}, mujoco, os; print(os.environ['MUJOCO_GL'], mujoco.Renderer.__name__)"
    environment = {**os.environ, "MUJOCO_GL": "no-such-thing"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert done.stdout == "no-such-thing Renderer\n", done.stderr


def test_a_programming_error_stays_loud(monkeypatch):
    fail_with(ZeroDivisionError("bug"), monkeypatch)
    with pytest.raises(ZeroDivisionError):
        command.main(["context"])


def test_the_debug_switch_shows_where_an_error_came_from(monkeypatch):
    monkeypatch.setenv("EUREKA_DEBUG", "1")
    fail_with(ModelError("x"), monkeypatch)
    with pytest.raises(ModelError):
        command.main(["context"])


def test_the_version_is_told(capsys):
    assert run("--version") == 0
    assert capsys.readouterr().out == f"openeureka {__version__}\n"


def test_ctrl_c_is_one_word_and_exit_code_130(monkeypatch, capsys):
    fail_with(KeyboardInterrupt(), monkeypatch)
    assert run("context") == 130
    assert capsys.readouterr().err == "Stopped.\n"


PROJECT = Path(__file__).parents[2] / "pyproject.toml"
MODULE, NAME = tomllib.loads(PROJECT.read_text())["project"]["scripts"]["eureka"].split(":")
INTERRUPTED = """
import runpy, sys

class Person:
    def find_spec(self, name, path, target=None):
        if name == {during!r}:
            raise KeyboardInterrupt

sys.meta_path.insert(0, Person())
sys.argv = ["eureka", "envs"]
"""


COMMAND = f"from {MODULE} import {NAME}; sys.exit({NAME}())"


@pytest.mark.parametrize(
    ("way", "during"),
    [
        (COMMAND, "openeureka.cli.main"),
        (COMMAND, "typer"),
        (COMMAND, "openeureka.cli.settings"),
        (COMMAND, "torch"),
        ("runpy.run_module('openeureka', run_name='__main__')", "typer"),
    ],
)
def test_ctrl_c_while_the_command_loads_ends_it_without_a_traceback(way, during):
    code = INTERRUPTED.format(during=during) + way
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (ended.returncode, ended.stdout) == (130, ""), ended.stderr
    assert ended.stderr == ("Stopped.\n" if during == "torch" else "")


def test_a_working_directory_that_is_gone_is_one_sentence(monkeypatch, capsys, tmp_path):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    assert run("stop", "x") == 2
    assert capsys.readouterr().err == "The working directory was deleted; cd to another.\n"


def test_what_a_terminal_cannot_show_is_shown_in_another_way():
    words = ["run", "a\\u00b1b\\u2026\\u00e9"]
    code = f'from openeureka.cli.main import main; main([{words[0]!r}, "{words[1]}"])'
    environment = {**os.environ, "LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, env=environment)
    assert (ended.returncode, ended.stderr[:13]) == (2, b"`a+-b...?` is"), ended.stderr
