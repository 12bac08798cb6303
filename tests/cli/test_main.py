import subprocess
import sys

import pytest

from openeureka.cli import main as command
from openeureka.errors import ModelError


def run(*words: str) -> int:
    """Exit code of a command line."""
    with pytest.raises(SystemExit) as exit:
        command.main(words)
    return int(exit.value.code or 0)


COMMANDS = sorted(info.callback.__name__ for info in command.app.registered_commands if info.callback)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_every_command_shows_an_example_of_itself(name, capsys):
    assert run(name, "--help") == 0
    assert f"Example: eureka {name}" in capsys.readouterr().out


def test_help_imports_nothing_slow():
    code = (
        "import sys\n"
        "from openeureka.cli.main import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: print(sorted({'torch', 'mujoco', 'matplotlib', 'openai'} & set(sys.modules)))"
    )
    output = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert output.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("context", "env=cartpol"), "There is no environment `cartpol`. Did you mean `cartpole`?"),
        (("context", "enf=cartpole"), "Unknown setting `enf`. Did you mean `env`?"),
        (("play", "env=cartpole", "policy=absent.safetensors"), "Cannot read the policy absent.safetensors"),
        (("play", "env=cartpole", "seconds=0"), "`seconds` must be above 0"),
    ],
)
def test_a_mistake_is_one_sentence_and_exit_code_2(words, sentence, capsys):
    assert run(*words) == 2
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


def test_a_full_disk_is_one_sentence(monkeypatch, capsys):
    fail_with(OSError(28, "No space left on device", "outputs/x"), monkeypatch)
    assert run("context") == 5
    assert capsys.readouterr().err.startswith("Cannot use outputs/x: No space left on device.")


def test_ctrl_c_exits_with_130(monkeypatch):
    fail_with(KeyboardInterrupt(), monkeypatch)
    assert run("context") == 130


def test_a_programming_error_stays_loud(monkeypatch):
    fail_with(ZeroDivisionError("bug"), monkeypatch)
    with pytest.raises(ZeroDivisionError):
        command.main(["context"])


def test_the_debug_switch_shows_where_an_error_came_from(monkeypatch):
    monkeypatch.setenv("EUREKA_DEBUG", "1")
    fail_with(ModelError("x"), monkeypatch)
    with pytest.raises(ModelError):
        command.main(["context"])
