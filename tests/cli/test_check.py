import json
import os
import pty
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from toys import eureka

from openeureka.cli.tasks import check, context
from openeureka.errors import RewardFileError

GOOD = """
def compute_reward(pole_angle):
    upright = torch.exp(-10.0 * pole_angle**2)
    return upright, {"upright": upright}
"""
CART = """<mujoco><worldbody><body name="cart"><joint name="rail" type="slide" range="-1 1"/>
<geom size="0.1"/></body></worldbody>
<actuator><motor joint="rail" ctrlrange="-1 1"/></actuator></mujoco>"""
BAD = """
def compute_reward(pole_angel):
    return pole_angel, {}
"""


def test_a_refused_reward_is_explained_with_line_rule_and_fix(one_sandbox, tmp_path, capsys):
    (tmp_path / "bad.py").write_text(BAD)
    assert check(["env=cartpole", f"{tmp_path}/bad.py"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].endswith("bad.py: refused (it uses something that is not allowed in a reward; it was not run)")
    assert lines[1].startswith("line 2: `pole_angel` is not a state variable")
    assert "did you mean `pole_angle`?" in lines[1]


PRINTS = """import ctypes
import os
print("python")
os.write(1, b"descriptor\\n")
ctypes.CDLL(None).puts(b"library")
"""


def test_what_a_task_prints_is_no_part_of_the_answer(tmp_path, capfd):
    task = (Path(__file__).parents[2] / "examples" / "pendulum.py").read_text()
    (tmp_path / "mine.py").write_text(task.replace("\nimport", f"\n{PRINTS}import", 1))
    (tmp_path / "good.py").write_text(GOOD.replace("pole_angle", "angle"))
    assert check([f"env={tmp_path}/mine.py", f"{tmp_path}/good.py"], as_json=True) == 0
    printed = capfd.readouterr()
    assert json.loads(printed.out)["verdict"] == "accepted"
    assert {"python", "descriptor", "library"} <= set(printed.err.split())
    (tmp_path / "another.py").write_text((tmp_path / "mine.py").read_text())
    context([f"env={tmp_path}/another.py"])
    printed = capfd.readouterr()
    assert printed.out.startswith("Task: ") and "library" not in printed.out and "library" in printed.err


@pytest.mark.parametrize("words", ["context env=cartpole", "new cart.py model=cart.xml"])
def test_a_person_sees_that_a_task_is_tried_and_a_program_does_not(tmp_path, capfd, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TERM", "xterm")
    (tmp_path / "cart.xml").write_text(CART)
    assert eureka(*words.split()) == 0
    quiet = capfd.readouterr()
    assert quiet.out.startswith(("Task: ", "Wrote cart.py: ")) and quiet.err == ""
    (tmp_path / "cart.py").unlink(missing_ok=True)
    person, terminal = pty.openpty()
    with monkeypatch.context() as seen, open(terminal, "w") as stderr:
        seen.setattr(sys, "stderr", stderr)
        assert eureka(*words.split()) == 0
    assert b"Trying the task out" in b"".join(_read(person)) and capfd.readouterr().out == quiet.out
    os.close(person)


def _read(person: int) -> Iterator[bytes]:
    """What was written to a terminal that nobody writes to any more: it comes in pieces."""
    with suppress(OSError):
        while piece := os.read(person, 65_536):
            yield piece


def test_a_missing_or_binary_file_is_named(tmp_path):
    (tmp_path / "binary.py").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(
        RewardFileError, match=r"Cannot read the reward file .*absent\.py: No such file or directory\.$"
    ):
        check(["env=cartpole", f"{tmp_path}/absent.py"])
    with pytest.raises(RewardFileError, match=r"human: No such .* task's own; here a name is that of a file\.$"):
        check(["human"])
    with pytest.raises(RewardFileError, match=r"binary\.py is not a text file"):
        check(["env=cartpole", f"{tmp_path}/binary.py"])


def checked(tmp_path, text: str, capsys) -> list[str]:
    (tmp_path / "reward.txt").write_text(text)
    check(["env=cartpole", f"{tmp_path}/reward.txt"])
    return capsys.readouterr().out.splitlines()


def test_the_program_of_a_chat_reply_is_found_and_said_to_be(one_sandbox, tmp_path, capsys):
    note, verdict, *_ = checked(tmp_path, f"Sure! Here it is.\n\n```python{GOOD}```\nIt is smooth.\n", capsys)
    assert note.endswith("reward.txt has text around the program; lines are counted from the program's first.")
    assert verdict.endswith("reward.txt: accepted (it can train)")


@pytest.mark.parametrize(
    ("call", "says"),
    [
        ("np.exp(pole_angle)", "`np.exp` takes numbers and this is a tensor [branch]; use `torch.exp`"),
        ("math.cos(pole_angle)", "`math.cos` takes numbers and this is a tensor [branch]; use `torch.cos`"),
        ("np.abs(pole_angle)", "`numpy.abs` is not available to a reward [torch-function]; use `torch.abs`"),
        ("numpy.linalg.norm(pole_angle)", "[torch-function]; use `torch.linalg.norm`"),
        ("np.power(pole_angle, 2)", "use `torch.pow`"),
    ],
)
def test_what_torch_calls_a_function_of_numpy_is_named(one_sandbox, tmp_path, capsys, call, says):
    text = f"import numpy, math\nimport numpy as np\n\n\ndef compute_reward(pole_angle):\n    return {call}, {{}}\n"
    _, finding = checked(tmp_path, text, capsys)
    assert finding.startswith("line 6: ") and finding.endswith(says)


def test_a_line_that_python_cannot_read_is_shown(one_sandbox, tmp_path, capsys):
    head, finding, line = checked(tmp_path, "def compute_reward(x):\n    y = (x\n    return y, {}\n", capsys)
    assert head.endswith("refused (Python cannot read it; it was not run)")
    assert finding == "line 2: Python cannot read it: '(' was never closed [syntax]"
    assert line == "    y = (x"


def test_a_draft_above_a_line_that_python_cannot_read_is_not_taken_for_the_reward(one_sandbox, tmp_path, capsys):
    _, finding, line = checked(tmp_path, f"{GOOD}\n\ndef my_reward(pole_angle)\n    return -pole_angle, {{}}\n", capsys)
    assert finding == "line 7: Python cannot read it: expected ':' [syntax]"
    assert line == "    def my_reward(pole_angle)"


def test_a_verdict_is_json_for_programs(one_sandbox, tmp_path, capsys):
    (tmp_path / "good.py").write_text(GOOD)
    (tmp_path / "bad.py").write_text(BAD)
    assert check([f"{tmp_path}/good.py"], as_json=True) == 0
    assert json.loads(capsys.readouterr().out) == {"verdict": "accepted", "findings": [], "components": ["upright"]}
    assert check([f"{tmp_path}/bad.py"], as_json=True) == 1
    found = json.loads(capsys.readouterr().out)
    assert (found["verdict"], found["findings"][0]["line"]) == ("refused", 2)


def test_a_good_reward_is_accepted_and_files_that_lie_around_are_not_imported(tmp_path, monkeypatch, capsys):
    (tmp_path / "good.py").write_text(GOOD)
    (tmp_path / "tempfile.py").write_text(f"open({str(tmp_path / 'mark')!r}, 'w')\n")  # hostile
    (tmp_path / "glob.py").write_text("raise RuntimeError('my own notes on globs')\n")  # innocent
    monkeypatch.chdir(tmp_path)
    assert check(["env=cartpole", "good.py"]) == 0
    text = capsys.readouterr().out
    assert "good.py: accepted" in text and "components: upright" in text
    assert not (tmp_path / "mark").exists()
