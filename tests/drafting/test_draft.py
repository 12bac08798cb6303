"""Tasks that `eureka new` drafts are whole tasks, whatever the robot."""

import importlib.util
import math
from pathlib import Path

import pytest
import torch

from openeureka.drafting.draft import class_name, draft
from openeureka.errors import TaskError
from openeureka.tasks.context import context
from openeureka.tasks.record import record_states
from openeureka.tasks.registry import get, make
from openeureka.testing.conformance.task import TaskConformance

_WHEEL = importlib.util.find_spec("gymnasium")
assert _WHEEL is not None and _WHEEL.submodule_search_locations
ROBOTS = Path(_WHEEL.submodule_search_locations[0]) / "envs" / "mujoco" / "assets"

# What models may have besides hinges: names that clash or are missing, a ball joint, a driven tendon, a loose object,
# a keyframe, an input without a range, a joint at its limit.
ODDITIES = """
<mujoco>
  <option timestep="0.004"/>
  <worldbody>
    <geom type="plane" size="2 2 0.1"/>
    <body name="joint" pos="0 0 1">
      <joint name="base turn" axis="0 0 1"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/>
      <body pos="0.3 0 0">
        <joint axis="0 1 0" range="0 90" limited="true"/>
        <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.03"/>
        <body name="tip" pos="0.23 0 0"><joint type="ball"/><geom size="0.02"/></body>
      </body>
    </body>
    <body name="tip_" pos="0.5 0.5 0.05"><freejoint/><geom type="box" size="0.05 0.05 0.05"/></body>
  </worldbody>
  <tendon><fixed name="both"><joint joint="base turn" coef="1"/></fixed></tendon>
  <actuator>
    <motor tendon="both"/>
    <position joint="base turn" ctrlrange="-0.5 1.5" kp="2"/>
  </actuator>
  <keyframe><key qpos="0.3 0 1 0 0 0 0.5 0.5 0.05 1 0 0 0"/></keyframe>
</mujoco>
"""

DRONE = """
<mujoco>
  <worldbody>
    <body name="frame" pos="0 0 1"><freejoint/><geom type="box" size="0.1 0.1 0.02"/>
      <site name="left" pos="0 0.1 0"/><site name="right" pos="0 -0.1 0"/>
    </body>
  </worldbody>
  <actuator>
    <motor site="left" gear="0 0 1 0 0 0" ctrlrange="0 8"/><motor site="right" gear="0 0 1 0 0 0" ctrlrange="0 8"/>
  </actuator>
</mujoco>
"""


# An arm, a puck on slides with a touch sensor, a goal on a mocap body, and sensors that are awkward: one is named like
# a state variable, one has no name, one has a reference frame, one is a user sensor.
TABLE = """
<mujoco>
  <option timestep="0.005"/>
  <worldbody>
    <geom type="plane" size="2 2 0.1"/>
    <body name="arm" pos="0 0 0.03">
      <joint name="turn" axis="0 0 1"/>
      <geom type="capsule" fromto="0.05 0 0 0.4 0 0" size="0.02"/>
      <site name="imu" pos="0.2 0 0"/>
    </body>
    <body name="puck" pos="0.3 0.2 0.03">
      <joint name="puck_x" type="slide" axis="1 0 0"/><joint name="puck_y" type="slide" axis="0 1 0"/>
      <geom type="cylinder" size="0.04 0.02"/><site name="rim" type="cylinder" size="0.05 0.03"/>
    </body>
    <body name="goal" mocap="true" pos="0.3 -0.2 0.03">
      <geom type="cylinder" size="0.04 0.001" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <actuator><motor joint="turn" ctrlrange="-1 1" ctrllimited="true"/></actuator>
  <sensor>
    <touch name="puck touch" site="rim"/>
    <gyro name="actions" site="imu"/>
    <framequat name="arm_turn" objtype="xbody" objname="arm"/>
    <framepos objtype="body" objname="puck" reftype="xbody" refname="arm"/>
    <user name="nothing" dim="2"/>
  </sensor>
</mujoco>
"""


def drafted(folder: Path, robot: Path, intent: str = "") -> str:
    """Draft a task in the folder, and return its name for `env=`."""
    path = folder / f"{robot.stem}.py"
    path.write_text(draft(path, robot, intent).text)
    return f"{path}:{class_name(path)}"


def odd(folder: Path, model: str = ODDITIES) -> Path:
    robot = folder / "odd.xml"
    robot.write_text(model)
    return robot


def test_a_model_in_a_folder_with_a_quotation_mark_in_its_name_is_found(tmp_path: Path):
    folder, elsewhere = tmp_path / '5" wheels', tmp_path / "elsewhere"
    for place in (folder, elsewhere):
        place.mkdir()
    for place in (tmp_path, elsewhere):  # the path is relative to the first, and absolute from the second
        assert make(drafted(place, odd(folder, TABLE)), worlds=1).task.model().bodies


@pytest.mark.filterwarnings("ignore:compiler attribute")
@pytest.mark.parametrize("robot", sorted(ROBOTS.glob("*.xml")), ids=lambda path: path.stem)
def test_every_robot_of_gymnasium_becomes_a_task_that_steps(tmp_path: Path, robot: Path):
    simulation = make(drafted(tmp_path, robot), worlds=4)
    simulation.reset()
    for _ in range(25):
        step = simulation.step(torch.rand(4, simulation.task.num_actions) * 2.0 - 1.0)
    assert simulation.bad_total == 0
    assert bool(step.observation.isfinite().all()) and bool(simulation.task.human_reward(step.state).isfinite().all())


class Drafted(TaskConformance):
    robot: Path
    random_worlds = 16

    @pytest.fixture(autouse=True, scope="class")
    @classmethod
    def _draft(cls, tmp_path_factory: pytest.TempPathFactory):
        cls.env = drafted(tmp_path_factory.mktemp("drafted"), cls.robot)


class TestHopper(Drafted):
    robot = ROBOTS / "hopper.xml"


class TestAnt(Drafted):
    robot = ROBOTS / "ant.xml"


class TestReacher(Drafted):
    robot = ROBOTS / "reacher.xml"


class TestOddities(Drafted):
    model = ODDITIES

    @pytest.fixture(autouse=True, scope="class")
    @classmethod
    def _draft(cls, tmp_path_factory: pytest.TempPathFactory):
        folder = tmp_path_factory.mktemp("odd")
        cls.env = drafted(folder, odd(folder, cls.model))


class TestDrone(TestOddities):
    model = DRONE


class TestTable(TestOddities):
    model = TABLE


def test_runners_run_fall_and_start_where_the_model_stands(tmp_path: Path):
    simulation = make(drafted(tmp_path, ROBOTS / "ant.xml"), worlds=2)
    simulation.reset()
    state = simulation.current_state()
    assert {"forward_speed", "height", "upright", "torso_pos", "torso_quat", "joint_pos"} <= state.keys()
    torch.testing.assert_close(state["height"], torch.full((2,), 0.75), atol=1e-3, rtol=0)
    torch.testing.assert_close(state["upright"], torch.ones(2), atol=1e-3, rtol=0)
    qvel = simulation.sim.bind("qvel")
    qvel[:, 0] = torch.tensor([2.0, -1.0])
    simulation.sim.forward(torch.arange(2))
    state = simulation.current_state()
    assert state["forward_speed"].tolist() == [2.0, -1.0]
    assert simulation.task.sparse_reward(state).tolist() == [2.0, -1.0]
    # The model file has the torso at 0.75 m, but the ant stands with it at 0.405 m. Of that, 0.6 is 0.243 m.
    low = {**state, "height": torch.tensor([0.23, 0.26])}
    assert simulation.task.terminated(low).tolist() == [True, False]
    assert simulation.task.ends == "An episode ends early when torso is lower than 0.243 m."


def test_others_reach_for_a_point_that_they_can_reach(tmp_path: Path):
    simulation = make(drafted(tmp_path, ROBOTS / "reacher.xml"), worlds=1)
    simulation.reset()
    state = simulation.current_state()
    goal = state["goal_pos"][0]
    assert float(goal[:2].norm()) < 0.22 and not bool(simulation.task.sparse_reward(state).any())
    there = {**state, "fingertip_pos": state["goal_pos"] + 0.01}
    assert bool(simulation.task.sparse_reward(there).all())
    assert float(simulation.task.human_reward(there)) > float(simulation.task.human_reward(state))


# Two links. {0} stands for attributes of both joints, {1} for the actuators, most of which state no range.
LINKS = """
<mujoco>
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="near"><joint name="turn" axis="0 1 0" range="-170 170" {0}/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02"/>
      <body name="far" pos="0.3 0 0"><joint name="bend" axis="0 1 0" range="-170 170" {0}/>
        <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <actuator>{1}</actuator>
</mujoco>
"""


def test_servos_reach_the_point_that_is_said_to_be_within_reach(tmp_path: Path):
    servos = '<position joint="turn" kp="30" dampratio="1"/><position joint="bend" kp="60" dampratio="1" gear="-2"/>'
    simulation = make(drafted(tmp_path, odd(tmp_path, LINKS.format("", servos))), worlds=121)
    simulation.reset()
    held = torch.cartesian_prod(*2 * [torch.linspace(-1.0, 1.0, 11)])
    scored = torch.zeros(121)
    for _ in range(100):
        scored += simulation.step(held).score.value
    assert bool((scored > 0).any()), "no constant action brings the tip to its goal"
    joints = simulation.current_state()["joint_pos"]
    assert joints[-1].tolist() == pytest.approx([math.radians(170), -math.radians(170)], abs=0.05)


def test_what_servos_cannot_reach_is_not_said_to_be_within_reach(tmp_path: Path):
    servo = '<position joint="{}" kp="30" ctrlrange="-0.1 0.1"/>'
    path, robot = tmp_path / "odd.py", odd(tmp_path, LINKS.format("", servo.format("turn") + servo.format("bend")))
    point = draft(path, robot).aim.point
    assert point[0] > 0.44  # 0.3 cos 0.1 + 0.15 cos 0.2 = 0.4455 at the servos' limits, 0.45 with straight joints


@pytest.mark.parametrize(
    ("joints", "actuators", "expected", "guessed"),
    [
        # 88 N m at each joint; behind a gear of 4, the motor needs 22 for that.
        ('actuatorfrcrange="-88 88"', '<motor joint="turn"/><motor joint="bend" gear="4"/>', [88.0, 22.0], ()),
        ('actuatorfrcrange="-88 88"', '<motor joint="turn" forcerange="-40 40"/>', [40.0], ()),
        ("", '<motor joint="turn" forcerange="-40 40"/><motor name="weak" joint="bend"/>', [40.0, 1.0], ("weak",)),
        ("", '<velocity name="rate" joint="turn" kv="1"/>', [1.0], ("rate",)),
        ("", '<motor joint="turn" ctrlrange="-3 3"/>', [3.0], ()),
        ("", '<motor name="any" joint="turn" ctrlrange="-inf inf"/>', [1.0], ("any",)),
        ("", '<muscle joint="turn" lengthrange="0 1"/>', [1.0], ()),
    ],
)
def test_a_motor_without_a_range_goes_as_far_as_its_forces_do_or_is_said_to_be_guessed(
    tmp_path: Path, joints: str, actuators: str, expected: list[float], guessed: tuple[str, ...]
):
    robot = odd(tmp_path, LINKS.format(joints, actuators))
    assert draft(tmp_path / "odd.py", robot).guessed == guessed
    simulation = make(drafted(tmp_path, robot), worlds=1)
    simulation.reset()
    simulation.step(torch.ones(1, len(expected)))
    assert simulation.sim.bind("ctrl")[0].tolist() == pytest.approx(expected)


def test_muscles_are_excited_from_nothing_to_all(tmp_path: Path):
    muscle = '<muscle joint="turn" lengthrange="0 1"/>'
    assert "CONTROLS = ((0.0, 1.0),)" in draft(tmp_path / "odd.py", odd(tmp_path, LINKS.format("", muscle))).text


def test_an_object_on_slides_is_brought_to_the_goal(tmp_path: Path):
    simulation = make(drafted(tmp_path, odd(tmp_path, TABLE)), worlds=2)
    task = simulation.task
    simulation.reset()
    simulation.sim.bind("qpos")[:, 1:3] = torch.tensor([[0.0, 0.0], [0.05, -0.38]])
    simulation.sim.forward(torch.arange(2))
    state = simulation.current_state()
    torch.testing.assert_close(state["puck_pos"], torch.tensor([[0.3, 0.2, 0.03], [0.35, -0.18, 0.03]]))
    torch.testing.assert_close(state["goal_pos"], torch.tensor([[0.3, -0.2, 0.03]] * 2))
    # The puck counts as there within a fifth of the 0.4 m at the start, 0.08 m: sqrt(0.05^2 + 0.02^2) = 0.054 m does.
    assert task.sparse_reward(state).tolist() == [0.0, 1.0]
    nearer = {**state, "arm_pos": state["puck_pos"]}
    assert bool((task.human_reward(nearer) > task.human_reward(state)).all()), "reward does not rise near the puck"


def test_an_edit_of_the_model_leaves_what_a_draft_measures(tmp_path: Path):
    sensors = '<sensor><framepos name="where" objtype="site" objname="imu"/></sensor>'
    model = TABLE[: TABLE.index("<sensor>")] + sensors + "</mujoco>"
    lamp = """<body name="lamp" pos="0 0 1"><joint name="swing" axis="1 0 0"/><geom name="shade" size="0.1"/>
      <body pos="1 0 0"><joint type="ball"/><geom size="0.1"/></body><site name="bulb"/></body>"""
    env = drafted(tmp_path, odd(tmp_path, model))
    states = []
    for before, after in (("", ""), ("<worldbody>", f"<worldbody>{lamp}"), ("<sensor>", '<sensor><clock name="now"/>')):
        odd(tmp_path, model.replace(before, after))
        simulation = make(env, worlds=1)
        simulation.reset()
        states.append(simulation.current_state())
    for name in ("puck_pos", "goal_pos", "arm_pos", "where"):
        assert all(torch.allclose(state[name], states[0][name], atol=0.11) for state in states), name
    assert all(state["joint_pos"].shape == (1, 3) for state in states)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('"goal"', '"gaol"', r"The model has no body `goal`, which the task names\. Did you mean `gaol`\?"),
        ('joint="turn"', 'joint="turns"', "The model has no joint `turn`, which the task names. Did you mean `turns`"),
        (
            '"puck touch"',
            '"contact"',
            "The model has no sensor `puck touch`, which the task names. It has contact, ",
        ),
        (
            'name="puck_x" type="slide"',
            'name="puck_x" type="ball"',
            "The joint `puck_x` of the model is not a hinge or",
        ),
    ],
)
def test_a_name_that_a_model_has_no_more_is_a_sentence(tmp_path: Path, old: str, new: str, problem: str):
    env = drafted(tmp_path, odd(tmp_path, TABLE))
    renamed = TABLE.replace('name="turn"', 'name="turns"') if "turns" in new else TABLE
    odd(tmp_path, renamed.replace(old, new))
    with pytest.raises(TaskError, match=problem):
        make(env, worlds=1)


def test_a_body_that_floats_no_more_is_a_sentence(tmp_path: Path):
    env = drafted(tmp_path, odd(tmp_path, DRONE))
    odd(tmp_path, DRONE.replace("<freejoint/>", '<joint type="slide" axis="0 0 1"/>'))
    with pytest.raises(TaskError, match="The body `frame` has no free joint; add <freejoint/> to it"):
        make(env, worlds=1)


def test_what_floats_has_the_speeds_that_mujoco_gives_it(tmp_path: Path):
    simulation = make(drafted(tmp_path, odd(tmp_path)), worlds=1)
    simulation.reset()
    qpos, qvel = simulation.sim.bind("qpos"), simulation.sim.bind("qvel")
    half = math.sqrt(0.5)
    qpos[:, -4:] = torch.tensor([half, 0.0, 0.0, half])  # a quarter turn about z
    qvel[:, -6:] = torch.tensor([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    simulation.sim.forward(torch.arange(1))
    state = simulation.current_state()
    torch.testing.assert_close(state["tip__pos"], torch.tensor([[0.5, 0.5, 0.05]]))
    torch.testing.assert_close(state["tip__quat"], torch.tensor([[0.0, 0.0, half, half]]))
    torch.testing.assert_close(state["tip__linvel"], torch.tensor([[1.0, 2.0, 3.0]]))
    torch.testing.assert_close(state["tip__angvel"], torch.tensor([[-5.0, 4.0, 6.0]]))


GRIPPER = """
<mujoco>
  <worldbody>
    <geom type="plane" size="1 1 0.1"/>
    <body name="palm" pos="0 0 0.3"><joint name="lift" type="slide" axis="0 0 1" range="-0.2 0.2"/>
      <geom type="box" size="0.04 0.06 0.02"/>
      <body name="left" pos="0 0.03 -0.06"><joint name="left" type="slide" axis="0 1 0" range="-0.02 0.02"/>
        <geom type="box" size="0.01 0.005 0.04"/></body>
      <body name="right" pos="0 -0.03 -0.06"><joint name="right" type="slide" axis="0 -1 0" range="-0.02 0.02"/>
        <geom type="box" size="0.01 0.005 0.04"/></body>
    </body>
  </worldbody>
  <actuator><position joint="lift" kp="300"/><position joint="left" kp="100"/></actuator>
  <equality>{}</equality>
</mujoco>
"""


class TestGripper(TestOddities):
    model = GRIPPER.format("")


def test_joints_sway_within_their_ranges_and_not_where_an_equality_holds_them(tmp_path: Path):
    simulation = make(drafted(tmp_path, odd(tmp_path, GRIPPER.format(""))), worlds=64)
    simulation.reset()
    low, high = simulation.current_state()["joint_pos"].aminmax(dim=0)
    # A joint starts within a tenth of its range: 0.4 m, 0.04 m and 0.04 m.
    assert high.tolist() == pytest.approx([0.04, 0.004, 0.004], rel=0.1) and bool((low < 0.0).all())
    held = GRIPPER.format('<joint joint1="left" joint2="right" polycoef="0.01 1 0 0 0"/>')
    simulation = make(drafted(tmp_path, odd(tmp_path, held)), worlds=8)
    simulation.reset()
    assert simulation.current_state()["joint_pos"][:, 1:].unique(dim=0).tolist() == [pytest.approx([0.01, 0.0])]


FOUR_BAR = """
<mujoco>
  <worldbody>
    <body name="crank" pos="0 0 1"><joint name="crank" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 .2" size=".02"/>
      <body name="coupler" pos="0 0 0.2"><joint name="coupler" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 .5 0 0" size=".02"/></body></body>
    <body name="rocker" pos="0.5 0 1"><joint name="rocker" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.2" size=".02"/></body>
  </worldbody>
  <equality><connect body1="coupler" body2="rocker" anchor="0.5 0 0"/></equality>
  <actuator><velocity joint="crank" kv="5" ctrlrange="-3 3"/></actuator>
</mujoco>
"""


def test_a_closed_loop_starts_closed(tmp_path: Path):
    simulation = make(drafted(tmp_path, odd(tmp_path, FOUR_BAR)), worlds=4)
    simulation.reset()
    assert not bool(simulation.current_state()["joint_pos"].any())


BALL_BOT = """
<mujoco>
  <worldbody>
    <geom type="plane" size="2 2 0.1" pos="0 0 {ground}"/>
    <body name="trunk" pos="0 0 {height}"><freejoint/><geom type="box" size="0.2 0.1 0.05"/>
      <body name="leg" pos="0.2 0 0"><joint name="hip" axis="0 1 0" range="-60 60"/>
        <geom type="capsule" fromto="0 0 0 0.2 0 -0.3" size="0.02"/>
        <geom type="capsule" fromto="0.2 -0.2 -0.3 0.2 0.2 -0.3" size="0.02"/></body>
      <body name="hind" pos="-0.2 0 0"><joint name="hind" axis="0 1 0" range="-60 60"/>
        <geom type="capsule" fromto="0 0 0 -0.2 0 -0.3" size="0.02"/>
        <geom type="capsule" fromto="-0.2 -0.2 -0.3 -0.2 0.2 -0.3" size="0.02"/></body>
    </body>
  </worldbody>
  <actuator><position joint="hip" kp="50" kv="2"/><position joint="hind" kp="50" kv="2"/></actuator>
</mujoco>
"""


@pytest.mark.parametrize(("height", "ground"), [(0.32, 0.0), (1.0, 0.0), (0.0, -0.32)])
def test_a_robot_has_fallen_when_it_is_low_against_where_it_stands(tmp_path: Path, height: float, ground: float):
    robot = odd(tmp_path, BALL_BOT.format(height=height, ground=ground))
    simulation = make(drafted(tmp_path, robot), worlds=4)
    simulation.reset()
    for _ in range(100):
        assert not bool(simulation.step(torch.zeros(4, 2)).done.any()), "a robot that stands still counts as fallen"
    # The feet are 0.3 m below the trunk and have a radius of 0.02 m, so it stands 0.32 m high.
    fallen = float(simulation.task.ends.split()[-2])
    assert fallen == pytest.approx(ground + 0.6 * 0.32, abs=0.003)


def test_a_robot_is_dropped_as_its_task_steps_it(tmp_path: Path):
    """Euler's method would fling these legs about before they land; the task steps with another."""
    robot = odd(tmp_path, BALL_BOT.format(height=1.0, ground=0.0).replace('kv="2"', 'kv="2000"'))
    assert float(get(drafted(tmp_path, robot)).ends.split()[-2]) == pytest.approx(0.6 * 0.32, abs=0.003)


def test_a_robot_on_the_ground_starts_above_it_however_it_sways(tmp_path: Path):
    simulation = make(drafted(tmp_path, odd(tmp_path, BALL_BOT.format(height=0.32, ground=0.0))), worlds=64)
    simulation.reset()
    deepest = 0.0
    for world in range(64):
        _, data = simulation.sim.snapshot(world)
        deepest = min([deepest, *(contact.dist for contact in data.contact[: data.ncon])])
    assert deepest > -1e-3


LOW_BOT = BALL_BOT.format(height=-0.65, ground=-0.97)


@pytest.mark.parametrize(
    ("robot", "height", "ends"),
    [
        (DRONE, 0.1, ""),
        (DRONE, 2.0, "An episode ends early when frame is lower than 0.6 m."),
        (LOW_BOT, -0.9, ""),
        (LOW_BOT, -0.65, "An episode ends early when trunk is lower than -0.778 m."),
    ],
)
def test_what_shall_come_near_the_ground_may(tmp_path: Path, robot: str, height: float, ends: str):
    target = f'<site name="target" pos="1 0 {height}"/></worldbody>'
    task = get(drafted(tmp_path, odd(tmp_path, robot.replace("</worldbody>", target))))
    assert (task.ends, task.counts_early) == (ends, bool(ends))


def test_the_hand_that_is_to_come_to_the_object_has_a_variable_whatever_it_is(tmp_path: Path):
    model = TABLE.replace(
        '<site name="imu" pos="0.2 0 0"/>', '<site name="imu"/><site name="fingertip" pos="0.4 0 0"/>'
    )
    simulation = make(drafted(tmp_path, odd(tmp_path, model), "to push the puck to the goal"), worlds=2)
    simulation.reset()
    state = simulation.step(torch.zeros(2, 1)).state
    assert simulation.task.human_reward(state).isfinite().all()
    assert torch.linalg.vector_norm(state["fingertip_pos"][:, :2], dim=1) == pytest.approx(0.4, abs=0.01)


def test_sensors_are_state_variables_as_mujoco_measures_them(tmp_path: Path):
    simulation = make(drafted(tmp_path, odd(tmp_path, TABLE)), worlds=1)
    spec = simulation.task.spec
    simulation.reset()
    qpos, qvel = simulation.sim.bind("qpos"), simulation.sim.bind("qvel")
    qpos[:], qvel[:] = torch.tensor([math.pi / 2, 0.0, 0.0]), torch.tensor([3.0, 0.0, 0.0])
    simulation.sim.forward(torch.arange(1))
    state = simulation.current_state()
    half = math.sqrt(0.5)
    torch.testing.assert_close(state["actions_"], torch.tensor([[0.0, 0.0, 3.0]]))
    torch.testing.assert_close(state["arm_turn"], torch.tensor([[0.0, 0.0, half, half]]))  # x, y, z, w
    torch.testing.assert_close(state["sensor3"], torch.tensor([[0.2, -0.3, 0.0]]))  # in the frame of an arm along y
    assert state["puck_touch"].shape == (1,) and spec["puck_touch"].meaning == "normal force that presses on rim [N]"
    assert spec["sensor3"].meaning == "position of the inertial frame of puck [m], seen from arm"
    assert "nothing" not in spec
    *_, touch, turning = simulation.task.observe({**state, "puck_touch": torch.tensor([7.0])})[0, :-3].split(
        [6, 3, 1, 3]
    )
    assert touch.tolist() == [7.0] and turning.tolist() == pytest.approx([0.0, 0.0, 3.0])


def test_a_draft_whose_f_is_not_understood_can_be_watched_and_not_trained(tmp_path: Path):
    env = drafted(tmp_path, odd(tmp_path, TABLE), "to juggle the puck")
    simulation = make(env, worlds=2)
    simulation.scored = False
    simulation.reset()
    assert simulation.step(torch.zeros(2, 1)).score.value.tolist() == [0.0, 0.0]
    for refused in (lambda: make(env, worlds=2).step(torch.zeros(2, 1)), lambda: record_states(env)):
        with pytest.raises(TaskError, match="odd.py does not say yet what F measures: write its `sparse_reward`"):
            refused()
    assert '"juggle"' in (tmp_path / "odd.py").read_text() and "goal_pos" not in simulation.task.spec


@pytest.mark.parametrize("turn", ["", 'mquat="0 1 0 0"'])
def test_bodies_that_are_moved_by_hand_start_at_the_first_keyframe_too(tmp_path: Path, turn: str):
    key = f'<keyframe><key qpos="0.5 0 0" mpos="0.1 -0.3 0.2" {turn}/></keyframe></mujoco>'
    env = drafted(tmp_path, odd(tmp_path, TABLE.replace("</mujoco>", key)))
    simulation = make(env, worlds=2)
    simulation.reset()
    torch.testing.assert_close(simulation.current_state()["goal_pos"], torch.tensor([[0.1, -0.3, 0.2]] * 2))
    # The puck at (0.3, 0.2, 0.03) is 0.565 m from the goal. A fifth of that is 0.113 m.
    assert "REACHED = 0.113" in Path(env.rpartition(":")[0]).read_text()
    expected = [0.0, 1.0, 0.0, 0.0] if turn else [1.0, 0.0, 0.0, 0.0]
    assert simulation.sim.bind("mocap_quat")[1].flatten().tolist() == expected


def test_muscles_and_speeds_start_at_the_first_keyframe_too(tmp_path: Path):
    muscles = '<muscle joint="turn" lengthrange="0 1"/><muscle joint="bend" lengthrange="0 1"/>'
    key = '<keyframe><key qpos="0.5 0.1" qvel="1 2" act="0.3 0.7"/></keyframe></mujoco>'
    simulation = make(drafted(tmp_path, odd(tmp_path, LINKS.format("", muscles).replace("</mujoco>", key))), worlds=2)
    simulation.reset()
    torch.testing.assert_close(simulation.sim.bind("act"), torch.tensor([[0.3, 0.7]] * 2))
    torch.testing.assert_close(simulation.sim.bind("qvel"), torch.tensor([[1.0, 2.0]] * 2), atol=0.051, rtol=0)


def test_what_a_draft_cannot_move_is_told_without_saying_that_nothing_floats(tmp_path: Path):
    sticky = (
        DRONE[: DRONE.index("<actuator>")] + '<actuator><adhesion body="frame" ctrlrange="0 1"/></actuator></mujoco>'
    )
    with pytest.raises(TaskError, match="No actuator of the model drives a joint or a tendon, or pushes a floating"):
        draft(tmp_path / "odd.py", odd(tmp_path, sticky))


def test_a_comment_about_a_robot_makes_no_urdf(tmp_path: Path):
    draft(tmp_path / "odd.py", odd(tmp_path, '<!-- from <robot name="x"> -->' + TABLE))


def test_a_model_by_another_ending_is_to_be_renamed(tmp_path: Path):
    robot = odd(tmp_path, TABLE).rename(tmp_path / "odd.mjcf")
    with pytest.raises(TaskError, match=r"odd\.mjcf: the name of a model must end in \.xml; rename it to odd\.xml\.$"):
        draft(tmp_path / "odd.py", robot)


def test_the_picture_of_a_draft_shows_wherever_an_arm_comes(tmp_path: Path):
    assert get(drafted(tmp_path, odd(tmp_path, TABLE))).view.swept
    assert not get(drafted(tmp_path, ROBOTS / "ant.xml")).view.swept


def test_odd_models_keep_their_names_ranges_and_pose(tmp_path: Path):
    simulation = make(drafted(tmp_path, odd(tmp_path)), worlds=1)
    task = simulation.task
    assert {"joint_pos", "joint2_quat", "tip_pos", "tip__pos", "tip__quat"} <= set(task.spec.names)
    assert "base turn, joint1" in task.spec["joint_pos"].meaning
    simulation.reset()
    joints = simulation.current_state()["joint_pos"][0]
    assert joints.tolist() == pytest.approx([0.3, 0.05], abs=0.051)  # the second starts 0.05 rad off its limit
    simulation.step(torch.ones(1, 2))
    assert simulation.sim.bind("ctrl")[0].tolist() == [1.0, 1.5]


def test_the_language_model_sees_the_state_and_not_the_score(tmp_path: Path):
    seen = context(drafted(tmp_path, ROBOTS / "hopper.xml"))
    assert "foot_pos" in seen.state.names and "def observe" in seen.source
    assert "FALLEN" not in seen.source and "sparse" not in seen.source


def test_the_guide_shows_what_a_draft_says(tmp_path: Path):
    guide = (Path(__file__).parents[2] / "docs/guides/your-own-task.md").read_text()
    shown = next(block for block in guide.split("```python\n") if "names = Names(self.sim)" in block).split("```")[0]
    arm = '<body name="arm"><joint name="turn"/><geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.02"/></body>'
    cube = '<body name="cube" pos="0.3 0.2 0.03"><freejoint/><geom type="box" size="0.03 0.03 0.03"/></body>'
    model = f"""<mujoco><worldbody>{arm}{cube}<site name="goal" pos="0.3 -0.2 0"/></worldbody>
      <actuator><motor joint="turn"/></actuator></mujoco>"""
    text = draft(tmp_path / "odd.py", odd(tmp_path, model)).text
    for part in shown.split("..."):
        lines = [line.strip() for line in part.strip().splitlines() if line.strip()]
        found = [line.strip() for line in text.splitlines() if line.strip() in lines]
        assert found[: len(lines)] == lines


def test_the_commands_in_a_draft_can_be_typed_as_they_stand(tmp_path: Path):
    assert f"eureka run 'env={tmp_path}/my robot.py'\n" in draft(tmp_path / "my robot.py", odd(tmp_path)).text


def test_a_model_beside_its_task_moves_with_it(tmp_path: Path):
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    drafted(first, odd(first))
    first.rename(second)
    assert get(f"{second / 'odd.py'}:Odd").compile_model().nu == 2


@pytest.mark.parametrize(
    ("name", "expected"), [("my_robot.py", "MyRobot"), ("2 legs.py", "Task2Legs"), ("a.b.py", "AB")]
)
def test_files_name_their_class(name: str, expected: str):
    assert class_name(Path(name)) == expected


def test_an_intent_is_taken_as_it_is_said(tmp_path: Path):
    path = tmp_path / "odd.py"
    path.write_text(draft(path, odd(tmp_path), "to wave.").text)
    assert path.read_text().startswith('"""Odd: to wave.\n') and get(f"{path}:Odd").description == "to wave"
    path.write_text(draft(path, odd(tmp_path), 'to "wave"\n at people \\ dogs').text)
    assert get(f"{path}:Odd").description == "to 'wave' at people / dogs"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (None, "There is no file"),
        ("<mujoco><worldbody><body></worldbody></mujoco>", "MuJoCo cannot read"),
        ("<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>", "has no actuators"),
    ],
)
def test_a_model_that_will_not_do_is_refused_in_a_sentence(tmp_path: Path, text: str | None, problem: str):
    robot = tmp_path / "robot.xml"
    if text is not None:
        robot.write_text(text)
    with pytest.raises(TaskError, match=problem):
        draft(tmp_path / "robot.py", robot)
