import pytest

from openeureka.cli import main as command
from openeureka.tasks.registry import get

CART = """
<mujoco>
  <worldbody>
    <body name="cart"><joint name="joint0" type="slide" axis="1 0 0" range="-1 1"/><geom size="0.1"/>
      <body name="pole"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 0.6" size="0.03"/></body>
    </body>
  </worldbody>
  <actuator><motor joint="joint0" gear="1"/></actuator>
</mujoco>
"""


@pytest.fixture
def robot(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cart.xml").write_text(CART)
    return tmp_path


def run(*words: str) -> int:
    with pytest.raises(SystemExit) as exit:
        command.main(words)
    return int(exit.value.code or 0)


def test_a_task_is_drafted_and_the_next_commands_are_named(robot, capsys):
    assert run("new", "cart.py", "model=cart.xml", "intent=to balance the pole") == 0
    printed = capsys.readouterr().out
    assert "Wrote cart.py: 10 observations, 1 actions, to balance the pole." in printed
    assert "  eureka run env=cart.py\n" in printed
    assert get(f"{robot}/cart.py").description == "to balance the pole"


def test_a_robot_that_flies_apart_is_drafted_with_a_warning(robot, capsys):
    (robot / "wild.xml").write_text(CART.replace('gear="1"', 'gear="1e9"'))
    assert run("new", "wild.py", "model=wild.xml") == 0
    assert "But its physics broke down" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "code", "problem"),
    [
        (["cart.txt", "model=cart.xml"], 2, "A task is a Python file, not cart.txt"),
        (["cart.py"], 2, "Name the robot"),
        (["model=cart.xml"], 2, "Name exactly one path"),
        (["there.py", "model=cart.xml"], 2, "there.py exists already"),
        (["nowhere/cart.py", "model=cart.xml"], 2, "There is no folder nowhere"),
        (["cart.py", "model=other.xml"], 2, "There is no model other.xml"),
        (["cart.py", "modle=cart.xml"], 2, "modle"),
    ],
)
def test_what_does_not_fit_is_refused_in_a_sentence_and_nothing_is_written(robot, capsys, words, code, problem):
    (robot / "there.py").write_text("mine")
    assert run("new", *words) == code
    assert problem in capsys.readouterr().err
    assert (robot / "there.py").read_text() == "mine"
    assert sorted(path.name for path in robot.iterdir()) == ["cart.xml", "there.py"]
