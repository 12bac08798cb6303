"""A URDF becomes a model that can be moved: actuators from joint limits, meshes where ROS packages have them."""

import struct
from pathlib import Path

import mujoco
import numpy as np
import pytest
import torch

from openeureka.drafting.draft import draft
from openeureka.drafting.survey import Survey
from openeureka.errors import TaskError
from openeureka.tasks.registry import make
from openeureka.tasks.start import home
from openeureka.tasks.urdf import read_urdf

ARM = """<?xml version="1.0"?>
<robot name="arm">
  <link name="base"><visual><geometry><mesh filename="package://robots/arm/meshes/base.dae"/></geometry></visual>
    <collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
  <link name="upper"><inertial><mass value="1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><mesh filename="package://robots/arm/meshes/upper.stl"/></geometry></collision></link>
  <link name="wrist"><inertial><mass value="0.5"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="0.05"/></geometry></collision></link>
  <link name="left"><inertial><mass value="0.1"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="right"><inertial><mass value="0.1"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="tool"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" effort="20" velocity="4"/></joint>
  <joint name="roll" type="continuous"><parent link="upper"/><child link="wrist"/><origin xyz="0 0 0.5"/>
    <axis xyz="0 0 1"/>
    <limit effort="5" velocity="10"/></joint>
  <joint name="grip" type="prismatic"><parent link="wrist"/><child link="left"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.04" effort="0" velocity="1"/></joint>
  <joint name="grip_too" type="prismatic"><parent link="wrist"/><child link="right"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.04" effort="3" velocity="1"/><mimic joint="grip" multiplier="-2" offset="0.01"/></joint>
  <joint name="mount" type="fixed"><parent link="wrist"/><child link="tool"/><origin xyz="0 0 0.1"/></joint>
</robot>
"""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    """The description in the layout of a ROS package: robots/arm/urdf/arm.urdf, with meshes in robots/arm/meshes."""
    for folder in ("urdf", "meshes"):
        (tmp_path / "robots" / "arm" / folder).mkdir(parents=True)
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.4]], dtype="<f4")
    faces = [corners[list(face)] for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))]
    records = b"".join(struct.pack("<3f", 0, 0, 0) + face.tobytes() + b"\0\0" for face in faces)
    (tmp_path / "robots/arm/meshes/upper.stl").write_bytes(bytes(80) + struct.pack("<I", len(faces)) + records)
    (tmp_path / "robots/arm/meshes/base.dae").write_text("<COLLADA/>")
    path = tmp_path / "robots/arm/urdf/arm.urdf"
    path.write_text(ARM)
    return path


def test_joint_limits_become_actuators(arm: Path):
    model = read_urdf(arm).compile()
    # A joint without effort, or one that mimics another, gets no actuator.
    assert [model.actuator(i).name for i in range(model.nu)] == ["shoulder", "roll"]
    servo, motor = model.actuator("shoulder"), model.actuator("roll")
    assert servo.ctrlrange.tolist() == [-1.0, 2.0] and servo.forcerange.tolist() == [-20.0, 20.0]
    assert servo.gainprm[0] == 80.0  # full effort, 20 N m, at an error of 0.25 rad
    assert motor.gear[0] == 5.0 and motor.ctrlrange.tolist() == [-1.0, 1.0]
    # With this damping, full effort moves the joint at its velocity limit: 20 N m / 4 rad/s, 5 N m / 10 rad/s.
    assert model.joint("shoulder").damping.tolist() == [5.0] and model.joint("roll").damping.tolist() == [0.5]


def test_a_joint_follows_the_one_that_it_mimics(arm: Path):
    model = read_urdf(arm).compile()
    assert model.neq == 1 and model.eq_data[0, :3].tolist() == [0.01, -2.0, 0.0]
    assert (model.joint(int(model.eq_obj1id[0])).name, model.joint(int(model.eq_obj2id[0])).name) == (
        "grip_too",
        "grip",
    )


def test_meshes_are_found_where_packages_have_them_and_unreadable_pictures_left_out(arm: Path):
    model = read_urdf(arm).compile()
    assert model.nmesh == 1
    elsewhere = arm.with_name("beside.urdf")
    elsewhere.write_text(ARM.replace("package://robots/arm/meshes/", "../meshes/"))
    assert read_urdf(elsewhere).compile().nmesh == 1


def test_what_mujoco_cannot_read_is_left_out_where_it_is_only_seen(arm: Path):
    (arm.parent / "text.stl").write_text("solid seen\nendsolid seen\n" + " " * 99)
    for shape in ('<mesh filename="text.stl"/>', '<sphere radius="0.0"/>', '<box size="1 0 1"/>'):
        arm.write_text(ARM.replace('<mesh filename="package://robots/arm/meshes/base.dae"/>', shape))
        assert read_urdf(arm).compile().nmesh == 1
    arm.write_text(ARM.replace("package://robots/arm/meshes/upper.stl", "text.stl"))
    with pytest.raises(TaskError, match=r"collision mesh text.stl of .*; convert it to a binary STL"):
        read_urdf(arm)


def test_a_binary_mesh_that_begins_like_a_text_is_read(arm: Path):
    mesh = arm.parents[1] / "meshes" / "upper.stl"
    mesh.write_bytes(b"solid" + mesh.read_bytes()[5:])
    assert read_urdf(arm).compile().nmesh == 1


def test_a_floating_robot_stands_on_a_floor(arm: Path):
    fixed, afloat = read_urdf(arm).compile(), read_urdf(arm, floating=True).compile()
    assert afloat.nv == fixed.nv + 6
    data = mujoco.MjData(afloat)
    mujoco.mj_forward(afloat, data)
    assert data.body("base").xpos[2] == pytest.approx(0.05, abs=1e-6)  # half of the box, which is 0.1 m high
    assert int(mujoco.mjtGeom.mjGEOM_PLANE) in afloat.geom_type and afloat.ngeom == fixed.ngeom + 1


@pytest.mark.parametrize(
    ("floating", "aim"), [(False, "to bring tool to the goal"), (True, "to make base move forward")]
)
def test_a_urdf_becomes_a_task_that_steps(arm: Path, tmp_path: Path, floating: bool, aim: str):
    path = tmp_path / "mine.py"
    path.write_text(draft(path, arm, floating=floating).text)
    simulation = make(str(path), worlds=2)
    simulation.reset()
    for _ in range(10):
        step = simulation.step(torch.rand(2, 2) * 2.0 - 1.0)
    assert simulation.bad_total == 0 and bool(step.observation.isfinite().all())
    assert simulation.task.description.startswith(aim)


@pytest.mark.parametrize(
    ("before", "after", "problem"),
    [
        ("upper.stl", "lower.stl", "meshes/lower.stl of .* is neither in its folder nor in one above it"),
        (
            "upper.stl",
            "base.dae",
            "cannot read the collision mesh .*/base.dae of .*; convert it to a binary STL",
        ),
        ('effort="', 'effort="0" was="', "has a <limit> with an effort above zero"),
        ('velocity="4"', 'velocity="fast"', "The limit velocity='fast' of joint shoulder is not a number"),
        ('effort="20"', 'effort="inf"', "The limit effort='inf' of joint shoulder is not finite; write a finite"),
        ('effort="20"', 'effort="nan"', "The limit effort='nan' of joint shoulder is not finite"),
        ('mimic joint="grip"', 'mimic joint="gripper"', "Joint grip_too mimics 'gripper', which is not a joint"),
        ("</robot>", "", "is not readable XML"),
        ("robot", "mujoco", "is not a URDF"),
        ('child link="upper"', 'child link="nowhere"', "MuJoCo cannot read"),
    ],
)
def test_what_is_wrong_with_a_urdf_is_one_sentence(arm: Path, before: str, after: str, problem: str):
    arm.write_text(ARM.replace(before, after))
    with pytest.raises(TaskError, match=problem) as caught:
        read_urdf(arm)
    assert "\n" not in str(caught.value)


def test_a_robot_without_joints_needs_motors_that_a_urdf_cannot_name(tmp_path: Path):
    (tmp_path / "drone.urdf").write_text(f'<robot name="drone"><link name="frame">{INERTIAL}</link></robot>')
    with pytest.raises(TaskError, match="has no joint that a motor could move; a drone's propellers need a MuJoCo"):
        read_urdf(tmp_path / "drone.urdf", floating=True)


def test_a_joint_of_any_speed_is_not_damped(arm: Path):
    arm.write_text(ARM.replace('velocity="4"', 'velocity="inf"'))
    assert read_urdf(arm).joint("shoulder").damping[0] == 0.0


@pytest.mark.parametrize("floating", [False, True])
def test_a_root_that_a_description_lets_float_stands_on_a_floor(arm: Path, tmp_path: Path, floating: bool):
    free = '<joint name="free" type="floating"><parent link="world"/><child link="base"/></joint>'
    arm.write_text(ARM.replace('<link name="base">', f'<link name="world"/>{free}<link name="base">', 1))
    drafted = draft(tmp_path / "mine.py", arm, floating=floating)
    assert drafted.aim.description == "to make base move forward, along x, as fast as possible"
    assert drafted.aim.doubt == ""
    data = mujoco.MjData(read_urdf(arm, floating=floating).compile())
    mujoco.mj_forward(data.model, data)
    assert data.model.nv == 6 + 4 and data.body("base").xpos[2] == pytest.approx(0.05)  # half of its box


def test_a_xacro_is_refused_with_the_command_that_expands_it(arm: Path, tmp_path: Path):
    with pytest.raises(TaskError, match="run `xacro"):
        draft(tmp_path / "mine.py", arm.rename(arm.with_suffix(".xacro")))


@pytest.mark.parametrize("height", [0.0, 0.5])
def test_a_robot_that_is_set_afloat_stands_on_its_floor_wherever_its_world_carries_it(tmp_path: Path, height: float):
    (tmp_path / "leg.urdf").write_text(f"""<robot name="leg"><link name="world"/>
      <link name="base"><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision>
        <inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="on" type="fixed"><parent link="world"/><child link="base"/><origin xyz="0 0 {height}"/></joint>
      <link name="arm"><inertial><mass value="1"/>
        <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
        <limit lower="-1" upper="1" effort="5" velocity="4"/></joint>
    </robot>""")
    model = read_urdf(tmp_path / "leg.urdf", floating=True).compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    assert data.geom("floor").xpos[2] == 0.0 and data.geom_xpos[1, 2] == pytest.approx(0.1)


INERTIAL = """<inertial><mass value="1"/>
  <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>"""


@pytest.mark.parametrize("between", [False, True])
def test_an_arm_is_not_held_by_the_base_that_it_reaches_into(tmp_path: Path, between: bool):
    """The collision shape of the first moving link begins 2 cm inside that of the base, as in models of real arms. The
    link hangs on the base itself or on a link that is fixed to it."""
    parent = "flange" if between else "base"
    (tmp_path / "arm.urdf").write_text(f"""<robot name="arm">
      <link name="base"><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
      <link name="flange"/><joint name="on" type="fixed"><parent link="base"/><child link="flange"/></joint>
      <link name="upper"/>
      <link name="shell">{INERTIAL}<collision><origin xyz="0 0 0.15"/>
        <geometry><box size="0.1 0.1 0.34"/></geometry></collision></link>
      <joint name="shut" type="fixed"><parent link="upper"/><child link="shell"/></joint>
      <link name="fore">{INERTIAL}<collision><geometry><sphere radius="0.05"/></geometry></collision></link>
      <joint name="turn" type="revolute"><parent link="{parent}"/><child link="upper"/><origin xyz="0 0 0.1"/>
        <axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" effort="20" velocity="4"/></joint>
      <joint name="bend" type="revolute"><parent link="shell"/><child link="fore"/><origin xyz="0 0 0.4"/>
        <axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" effort="20" velocity="4"/></joint>
    </robot>""")
    model = read_urdf(tmp_path / "arm.urdf").compile()
    data = mujoco.MjData(model)
    data.ctrl[:] = [1.0, 0.0]
    mujoco.mj_step(model, data, 2000)
    assert data.qpos[0] == pytest.approx(1.0, abs=0.15)  # the servo sags by less under the weight
    pairs = [set(divmod(signature, 1 << 16)) for signature in model.exclude_signature.tolist()]
    assert pairs == [{model.body("base").id, model.body("shell").id}]  # links further out may touch the base


@pytest.mark.parametrize("floating", [False, True])
def test_links_that_overlap_in_every_pose_do_not_push_each_other(tmp_path: Path, floating: bool):
    """The thigh, two joints away, is inside the base wherever it turns. The foot is in the base only at the start."""
    (tmp_path / "leg.urdf").write_text(f"""<robot name="leg">
      <link name="base">{INERTIAL}<collision><geometry><sphere radius="0.2"/></geometry></collision></link>
      <link name="hip">{INERTIAL}</link>
      <link name="thigh">{INERTIAL}<collision><geometry><box size="0.1 0.1 0.3"/></geometry></collision></link>
      <link name="shank">{INERTIAL}</link>
      <link name="foot">{INERTIAL}<collision><geometry><sphere radius="0.05"/></geometry></collision></link>
      <joint name="side" type="revolute"><parent link="base"/><child link="hip"/><origin xyz="0.1 0 0"/>
        <axis xyz="1 0 0"/><limit lower="-2" upper="2" effort="20" velocity="4"/></joint>
      <joint name="swing" type="continuous"><parent link="hip"/><child link="thigh"/><origin xyz="0.05 0 0"/>
        <axis xyz="0 1 0"/><limit effort="20" velocity="4"/></joint>
      <joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/><origin xyz="0 0 0.2"/>
        <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="20" velocity="4"/></joint>
      <joint name="ankle" type="fixed"><parent link="shank"/><child link="foot"/><origin xyz="-0.15 0 0"/></joint>
    </robot>""")
    model = read_urdf(tmp_path / "leg.urdf", floating=floating).compile()
    base, thigh = (model.body(name).id for name in ("base", "thigh"))
    pairs = sorted(divmod(signature, 1 << 16) for signature in model.exclude_signature.tolist())
    assert pairs == [(base, thigh)]


def test_what_stands_on_a_floor_stands_there_in_the_pose_that_episodes_begin_in(tmp_path: Path):
    """The leg is drawn level, which is outside its range. At 0.8 + 0.05 rad its foot is 0.376 m lower."""
    (tmp_path / "leg.urdf").write_text(f"""<robot name="leg">
      <link name="base">{INERTIAL}<collision><geometry><sphere radius="0.05"/></geometry></collision></link>
      <link name="leg">{INERTIAL}<collision><origin xyz="0.5 0 0"/>
        <geometry><sphere radius="0.05"/></geometry></collision></link>
      <joint name="hip" type="revolute"><parent link="base"/><child link="leg"/><axis xyz="0 1 0"/>
        <limit lower="0.8" upper="2.6" effort="5" velocity="4"/></joint>
    </robot>""")
    model = read_urdf(tmp_path / "leg.urdf", floating=True).compile()
    data = mujoco.MjData(model)
    data.qpos[:] = home(model)
    mujoco.mj_kinematics(model, data)
    foot = float(data.geom_xpos[-1, 2])
    assert data.body("base").xpos[2] - foot == pytest.approx(0.376, abs=1e-3)
    assert 0.05 <= foot < 0.08  # the foot has a radius of 5 cm, and its bounding box is turned, so it reaches lower
    fallen = Survey(model).fallen
    assert fallen is not None and fallen > 0.2
