import pytest
from toys import eureka as run

from openeureka.cli import new
from openeureka.errors import TaskError
from openeureka.film.stage import Stage
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


def test_a_task_is_drafted_and_the_next_commands_are_named(robot, capsys):
    assert run("new", "cart.py", "model=cart.xml", "intent=to balance the pole") == 0
    printed = capsys.readouterr().out
    assert "Wrote cart.py: 4 observations, 1 actions, to balance the pole." in printed
    assert 'F is not written yet. The draft does not guess it, because it does not know what "balance"' in printed
    line = (robot / "cart.py").read_text().splitlines().index("    def sparse_reward(self, s: State) -> Tensor:") + 1
    assert f"`sparse_reward`, cart.py line {line}" in printed and "object=NAME goal=NAME" in printed
    assert printed.endswith("Then\n  eureka play env=cart.py policy=random\n")  # nothing trains yet
    assert get(f"{robot}/cart.py").description == "to balance the pole"


def test_what_f_measures_is_said_to_be_a_guess(robot, capsys):
    assert run("new", "cart.py", "model=cart.xml") == 0
    printed = capsys.readouterr().out
    assert "F is the share of time that pole is within " in printed
    assert ": a guess from the model; to say what you want, give intent=.\n" in printed
    assert "  eureka run env=cart.py\n" in printed
    assert "no control range for actuator0: -1 to 1 is a guess, so set CONTROLS in cart.py." in printed
    assert "so the point is made up" in printed and "F ranks the rewards, whatever the intent says" in printed
    (robot / "goal.xml").write_text(CART.replace("</worldbody>", '<site name="goal" pos="1 0 0"/></worldbody>'))
    assert run("new", "goal.py", "model=goal.xml", "object=cart", "intent=to tidy up") == 0
    assert (
        "F is the share of time that cart is within 0.2 m of goal: a guess from what you said."
        in capsys.readouterr().out
    )


def test_a_draft_without_an_intent_asks_for_one(robot, capsys):
    (robot / "disk.xml").write_text(
        '<mujoco><worldbody><body name="disk"><joint name="spin" axis="0 0 1"/><geom type="cylinder" size="0.2 0.02"/>'
        '</body></worldbody><actuator><motor joint="spin"/></actuator></mujoco>'
    )
    assert run("new", "disk.py", "model=disk.xml") == 0
    printed = capsys.readouterr().out
    assert "Wrote disk.py: 2 observations, 1 actions.\n" in printed
    assert "no driven hinge or slide moves disk to another place" in printed
    assert "A search also needs the aim in words: write it in `description`, or give intent=." in printed
    assert run("context", "env=disk.py") == 2
    assert "`description` of the task `disk` is empty" in capsys.readouterr().err


def test_a_draft_without_an_f_shows_the_variables_to_write_it_with(robot, capsys):
    assert run("new", "cart.py", "model=cart.xml", "intent=to balance the pole.") == 0
    assert "1 actions, to balance the pole.\n" in capsys.readouterr().out
    assert run("context", "env=cart.py") == 0
    printed = capsys.readouterr()
    assert "pole_pos" in printed.out and "cart.py does not say yet what F measures" in printed.err


LEGGED = """
<mujoco>
  <compiler {}/>
  <worldbody>
    <geom type="plane" size="2 2 0.1"/>
    <body name="trunk" pos="0 0 0.3"><freejoint/><geom type="box" size="0.1 0.1 0.02"/>
      <body name="leg" pos="0 0 -0.02"><joint name="hip" axis="0 1 0" range="-60 60"/>
        <geom type="box" size="0.2 0.2 0.13" pos="0 0 -0.13"/></body>
    </body>
  </worldbody>
  <actuator><position joint="hip" kp="50" kv="2"/></actuator>
</mujoco>
"""


@pytest.mark.parametrize("floor", [True, False])
def test_a_robot_that_falls_without_actions_is_said_to(robot, capsys, floor):
    model = LEGGED.format("")
    (robot / "dog.xml").write_text(model if floor else model.replace('<geom type="plane" size="2 2 0.1"/>', ""))
    assert run("new", "dog.py", "model=dog.xml") == 0
    falls = "But without actions it falls within 0.5 s, which ends the episode.\nCheck the starting pose" in (
        capsys.readouterr().out
    )
    assert falls is not floor


def test_a_robot_that_flies_apart_before_it_stands_is_drafted_all_the_same(robot, capsys):
    wild = LEGGED.format("").replace("<worldbody>", '<option gravity="0 0 1e12"/><worldbody>')
    (robot / "dog.xml").write_text(wild)
    assert run("new", "dog.py", "model=dog.xml") == 0
    assert "its physics broke down" in capsys.readouterr().out


def test_what_mujoco_says_of_the_file_is_not_printed(robot, capsys, recwarn):
    (robot / "dog.xml").write_text(LEGGED.format('settotalmass="3"'))
    assert run("new", "dog.py", "model=dog.xml") == 0
    said = [warned.message for warned in recwarn if warned.category is UserWarning]  # no ResourceWarning of other tests
    assert not said and "Warning" not in capsys.readouterr().err


def test_an_empty_intent_says_nothing_and_any_file_name_names_a_class(robot):
    assert run("new", "x².py", "model=cart.xml", "intent= ") == 0
    assert get(f"{robot}/x².py").description == "to bring pole to the goal"


def test_a_draft_that_cannot_be_tried_leaves_no_file_behind(robot, monkeypatch):
    def broken(*_: object):
        raise TaskError("It does not step.")

    monkeypatch.setattr(new, "_try", broken)
    assert run("new", "cart.py", "model=cart.xml") != 0
    assert not (robot / "cart.py").exists()


def test_an_intent_of_several_lines_is_one_sentence(robot):
    assert run("new", "pole.py", "env=gym:CartPole-v1", "intent=to balance\nthe pole") == 0
    assert get(f"{robot}/pole.py").description == "to balance the pole"


def test_a_draft_without_an_f_is_played_and_not_searched_for(robot, capsys):
    assert run("new", "cart.py", "model=cart.xml", "intent=to balance the pole") == 0
    assert run("run", "env=cart.py", "model=random", "sample=2") == 2
    assert (
        capsys.readouterr().err.strip().endswith("cart.py does not say yet what F measures: write its `sparse_reward`.")
    )
    Stage(f"{robot}/cart.py", "zero", 0).step()


@pytest.mark.parametrize(
    ("before", "after", "advice"),
    [
        ('gear="1"', 'gear="1e9"', "Without actions it is stable: narrow CONTROLS"),
        ("<worldbody>", '<option gravity="0 0 -1e9"/><worldbody>', "It also does so without actions"),
    ],
)
def test_a_robot_that_flies_apart_is_drafted_with_a_warning(robot, capsys, before, after, advice):
    (robot / "wild.xml").write_text(CART.replace(before, after))
    assert run("new", "wild.py", "model=wild.xml") == 0
    printed = capsys.readouterr().out
    assert "But under random actions its physics broke down" in printed and advice in printed


def test_a_urdf_with_placeholders_for_limits_is_said_to_have_them(robot, capsys):
    inertia = "<inertia ixx='1e-4' iyy='1e-4' izz='1e-4' ixy='0' ixz='0' iyz='0'/>"
    inertial = f"<inertial><mass value='1'/>{inertia}</inertial>"
    (robot / "leg.urdf").write_text(f"""<robot name="leg"><link name="base"/><link name="leg">{inertial}</link>
      <joint name="hip" type="continuous"><parent link="base"/><child link="leg"/><axis xyz="0 1 0"/>
        <limit effort="1e9" velocity="1e9"/></joint></robot>""")
    assert run("new", "leg.py", "model=leg.urdf") == 0
    said = "Check the effort and velocity limits of its joints: the largest effort is 1e+09 for a robot of 1 kg.\n"
    assert said in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "code", "problem"),
    [
        (["cart.txt", "model=cart.xml"], 2, "A task is a Python file, not cart.txt"),
        (["cart.py"], 2, "Name a robot"),
        (["model=cart.xml"], 2, "Name exactly one path"),
        (["there.py", "model=cart.xml"], 2, "there.py exists already"),
        (["nowhere/cart.py", "model=cart.xml"], 2, "There is no folder nowhere"),
        (["cart.py", "model=other.xml"], 2, "There is no file other.xml"),
        (["cart.py", "modle=cart.xml"], 2, "modle"),
        (["cart.py", "model=cart.xml", "object=cat"], 2, "Did you mean `cart`?"),
        (["cart.py", "model=cart.xml", "floating=true"], 2, "`floating` is only for a URDF"),
        (["cart.py", "env=gym:CartPole-v1", "goal=cart"], 2, "leave them out with env="),
        (['c"art.py', "model=cart.xml"], 2, 'c"art.py has a character that is not allowed here'),
        (["cart.py", 'model=c"art.xml'], 2, "such as a quote or backslash; rename it."),
    ],
)
def test_what_does_not_fit_is_refused_in_a_sentence_and_nothing_is_written(robot, capsys, words, code, problem):
    (robot / "there.py").write_text("mine")
    assert run("new", *words) == code
    assert problem in capsys.readouterr().err
    assert (robot / "there.py").read_text() == "mine"
    assert sorted(path.name for path in robot.iterdir()) == ["cart.xml", "there.py"]
