"""What runs a policy without openeureka: ANYmal's, as best/ holds it."""

import importlib.util
import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
import torch
import yaml

from openeureka.errors import RewardFileError, TaskError
from openeureka.report import build, export
from openeureka.suite.isaac.ant import Ant
from openeureka.suite.isaac.anymal import DEFAULT_ANGLES, Anymal
from openeureka.tasks import registry
from openeureka.tasks.deployment import Deployment, Term, as_text, described
from openeureka.tasks.task import Task, mean_over_steps
from openeureka.training.policy import Player, Policy
from openeureka.types import StateSpec, StateVar

from .policies import policy

onnxruntime = pytest.importorskip("onnxruntime", reason="plays policy.onnx; comes with the extra dev")


@pytest.fixture(scope="module")
def wanted() -> Policy:
    return policy(48, 12, (32, 16))


@pytest.fixture(scope="module")
def folder(wanted: Policy, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("best")
    for name, content in export.deployed(wanted, Anymal).items():
        (made / name).write_bytes(content)
    return made


def test_the_script_acts_as_the_policy_does_here(wanted: Policy, folder: Path):
    """The script computes the observation itself. It is compared in four worlds with their own commands, from the drop
    on."""
    spec = importlib.util.spec_from_file_location("sim2sim", folder / "sim2sim.py")
    assert spec is not None and spec.loader is not None
    sim2sim = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sim2sim)
    env, play = registry.make("anymal", worlds=4, threads=1), Player([wanted])
    observation = env.reset()
    controllers = [sim2sim.Controller(folder) for _ in range(4)]
    limited = 0
    for _ in range(12):
        actions = play(observation)
        commands = env.task.compute_state()["commands"]
        for i, controller in enumerate(controllers):
            model, data = env.sim.snapshot(i)
            seen = controller.observe(*sim2sim.Robot(model, data, controller.joints).state(), commands[i].tolist())
            np.testing.assert_allclose(seen, observation[i], atol=1e-5)
            targets = controller.act(seen)
            np.testing.assert_allclose(controller.action, actions[i], atol=1e-5)
            np.testing.assert_allclose(targets, np.array(DEFAULT_ANGLES) + 0.5 * controller.action, atol=1e-6)
        limited += int((actions.abs() == 1.0).sum())
        step = env.step(actions)
        observation = step.observation
        for i in step.done.nonzero().flatten().tolist():
            controllers[i] = sim2sim.Controller(folder)
    assert 0 < limited < 12 * 4 * 12


def test_the_script_plays_with_three_packages_alone(folder: Path):
    blocked = "import runpy, sys; sys.modules.update(openeureka=None, torch=None, yaml=None, onnx=None); "
    code = f"{blocked}sys.argv = ['sim2sim.py', '--seconds', '0.2']; runpy.run_path('sim2sim.py', run_name='__main__')"
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("In the second half: forward ")


def test_the_script_needs_no_command_where_there_is_none(folder: Path, monkeypatch: pytest.MonkeyPatch):
    spec = importlib.util.spec_from_file_location("sim2sim", folder / "sim2sim.py")
    assert spec is not None and spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    told = []
    for commands in ([], ["forward"], ["forward", "left", "turning"]):
        monkeypatch.setattr(script, "Controller", lambda commands=commands: SimpleNamespace(commands=commands))
        monkeypatch.setattr(script, "play", lambda _, command, *__: told.append(command) or np.zeros((2, 3)))
        monkeypatch.setattr("sys.argv", ["sim2sim.py"])
        script.main()
    assert told == [[], [1.0], [1.0, 0.0, 0.0]]


def test_the_scene_beside_it_is_the_task_s_own(folder: Path):
    model, own = mujoco.MjModel.from_xml_path(str(folder / "scene.xml")), Anymal.compile_model()
    for field in ("body_mass", "body_inertia", "geom_size", "jnt_range", "actuator_gainprm", "actuator_biasprm"):
        np.testing.assert_allclose(getattr(model, field), getattr(own, field), rtol=1e-4, atol=1e-5)
    assert (model.opt.timestep, model.opt.integrator) == (own.opt.timestep, own.opt.integrator)


def test_file_and_metadata_say_the_same(folder: Path):
    about = yaml.safe_load((folder / "deploy.yaml").read_text())
    said = onnxruntime.InferenceSession(folder / "policy.onnx").get_modelmeta().custom_metadata_map
    assert set(said) == set(about) and said["env"] == about["env"] == "anymal"
    assert said["joint_names"] == ",".join(about["joint_names"]) and about["joint_names"][:2] == ["LF_HAA", "LF_HFE"]
    assert about["joint_stiffness"] == [85.0] * 12 and about["joint_damping"] == [2.0] * 12
    assert about["torque_limit"] == [80.0] * 12 and about["control_rate"] == 50.0 and about["simulation_rate"] == 200.0
    assert sum(about["observation_sizes"]) == len(about["observation_scales"]) == 48
    # The third term turns gravity forwards; the fourth are the commands, scaled by 2, 2 and 0.25.
    assert about["observation_names"][2:4] == ["gravity_forward", "commands"]
    assert about["observation_scales"][9:12] == [2.0, 2.0, 0.25]


def test_what_is_said_is_that_of_the_task_as_it_was_changed(wanted: Policy):
    found = yaml.safe_load(export.deployed(wanted, registry.get("anymal+lin_vel_scale=1.0"))["deploy.yaml"])
    assert found["observation_scales"][:3] == [1.0] * 3 and found["observation_scales"][9:12] == [1.0, 1.0, 0.25]


def test_a_drive_without_a_limit_is_said_to_have_none(wanted: Policy, monkeypatch: pytest.MonkeyPatch):
    spec, model = Anymal.compiled()
    model.actuator_forcelimited[:3] = 0
    model.actuator_forcerange[:3] = 0.0
    model.jnt_actfrclimited[2:4] = 1  # 0 is the base's free joint: these are the legs' second and third
    model.jnt_actfrcrange[2:4] = [-30.0, 30.0]
    monkeypatch.setattr(Anymal, "compiled", lambda: (spec, model))
    found = export.deployed(wanted, Anymal)
    limits = [float("inf"), 30.0, 30.0, *[80.0] * 9]
    assert yaml.safe_load(found["deploy.yaml"])["torque_limit"] == limits
    said = onnxruntime.InferenceSession(found["policy.onnx"]).get_modelmeta().custom_metadata_map["torque_limit"]
    assert [float(text) for text in said.split(",")] == limits


def test_a_task_that_does_not_say_what_it_observes_says_that(wanted: Policy):
    found = export.deployed(policy(60, 8, (8,)), Ant)
    assert set(found) == {"policy.onnx", "deploy.yaml"}
    assert "`ant` does not say what its observation consists of" in found["deploy.yaml"].decode()
    assert yaml.safe_load(found["deploy.yaml"])["env"] == "ant"


def test_a_policy_of_another_task_is_not_said_to_be_anymal_s():
    with pytest.raises(RewardFileError, match="network of the policy does not fit this task"):
        export.deployed(policy(60, 8, (8,)), Anymal)


LEG = """<mujoco><compiler meshdir="shapes" angle="radian"/><default><joint damping="3"/></default>
<asset><mesh name="trunk" file="trunk.stl"/></asset>
<worldbody><geom type="plane" size="0 0 1"/>
<body name="trunk" pos="0 0 1"><freejoint/><geom type="mesh" mesh="trunk"/>
<body name="leg" pos="0 0 -0.1"><joint name="hip" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02"/>
</body></body></worldbody>
<actuator><position name="hip" joint="hip" kp="50" kv="1" ctrlrange="-0.5 0.2" forcerange="-20 20"/></actuator>
</mujoco>
"""


DEPLOYMENT = Deployment(
    observation=(
        Term("base_angular_velocity", (0.25,)),
        Term("joint_offsets", (1.0,)),
        Term("joint_velocities", (0.1,)),
    ),
    default_pose=(0.1,),
    action_scale=0.5,
)


class Leg(Task):
    """One driven joint on a base with a free joint."""

    env, suite, description = "leg", "own", "to stand"
    episode_length, control_dt, substeps = 100, 0.02, 4
    num_observations, num_actions = 5, 1
    spec = StateSpec((StateVar(name="obs_buf", shape=(5,), meaning="observation"),))
    deployment = DEPLOYMENT
    folder: Path

    @staticmethod
    def model() -> mujoco.MjSpec:
        return mujoco.MjSpec.from_string(LEG)

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.qpos, self.qvel, self.ctrl = (self.sim.bind(field) for field in ("qpos", "qvel", "ctrl"))

    def apply_action(self, actions: torch.Tensor) -> None:
        self.ctrl[:] = 0.1 + 0.5 * actions

    def compute_state(self):
        return {}

    def observe(self, s):
        return torch.cat((0.25 * self.qvel[:, 3:6], self.qpos[:, 7:] - 0.1, 0.1 * self.qvel[:, 6:]), dim=-1)

    def terminated(self, s):
        return self.qpos[:, 2] < 0.0

    def reset(self, worlds):
        self.qvel[worlds] = self.noise.uniform(worlds, 7, -1.0, 1.0)

    def sparse_reward(self, s):
        return self.qpos[:, 2].clone()

    def fitness(self, s, ended):
        return mean_over_steps(self.sparse_reward(s))


@pytest.fixture
def leg(tmp_path: Path) -> type[Leg]:
    """A task whose robot has a mesh, in a folder that its XML names."""
    (tmp_path / "shapes").mkdir()
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.4]], dtype="<f4")
    faces = [corners[list(face)] for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))]
    records = b"".join(struct.pack("<3f", 0, 0, 0) + face.tobytes() + b"\0\0" for face in faces)
    (tmp_path / "shapes/trunk.stl").write_bytes(bytes(80) + struct.pack("<I", len(faces)) + records)
    (tmp_path / "leg.xml").write_text(LEG)
    model = staticmethod(lambda: mujoco.MjSpec.from_file(str(tmp_path / "leg.xml")))
    return type("Leg", (Leg,), {"folder": tmp_path, "model": model})


def test_the_file_tells_what_the_joint_adds_to_its_drive(leg: type[Leg]):
    own = 'name="hip" stiffness="4" springref="0.3" frictionloss="0.6" armature="0.02" axis'
    text = LEG.replace('name="hip" axis', own).replace('kv="1"', 'kv="1" damping="0.5" armature="0.01"')
    (leg.folder / "leg.xml").write_text(text)
    about = yaml.safe_load(export.deployed(policy(5, 1, (8,)), leg)["deploy.yaml"])
    assert (about["passive_stiffness"], about["passive_rest"], about["friction_loss"]) == ([4.0], [0.3], [0.6])
    assert about["armature"] == [pytest.approx(0.03)] and about["passive_damping"] == [3.5]  # joint 3, drive 0.5


def test_the_file_tells_targets_limits_and_both_dampings(leg: type[Leg], tmp_path: Path):
    found = export.deployed(policy(5, 1, (8,)), leg)
    about = yaml.safe_load(found["deploy.yaml"])
    assert (about["target_low"], about["target_high"]) == ([-0.5], [0.2])
    assert (about["joint_damping"], about["passive_damping"], about["torque_limit"]) == ([1.0], [3.0], [20.0])
    for name in ("policy.onnx", "sim2sim.py"):
        (tmp_path / name).write_bytes(found[name])
    spec = importlib.util.spec_from_file_location("sim2sim", tmp_path / "sim2sim.py")
    assert spec is not None and spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    controller = script.Controller(tmp_path)
    # Actions of -1 and 1 ask for 0.1 - 0.5 and 0.1 + 0.5 rad; the drive goes no further than 0.2.
    for action, target in ((-1.0, -0.4), (1.0, 0.2)):
        controller.session = SimpleNamespace(run=lambda *_, action=action: [np.array([[action]], np.float32)])
        assert controller.act(np.zeros(5, np.float32)) == pytest.approx([target])


def test_the_scene_of_a_robot_with_meshes_loads_where_its_own_files_are_gone(leg: type[Leg], tmp_path: Path):
    found, own = export.deployed(policy(5, 1, (8,)), leg), leg.compile_model()
    (tmp_path / "shapes").rename(tmp_path / "gone")
    for name, content in found.items():
        (tmp_path / "best" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "best" / name).write_bytes(content)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "best" / "scene.xml"))
    np.testing.assert_allclose(model.mesh_vert, own.mesh_vert, atol=1e-6)
    np.testing.assert_allclose(model.body_mass, own.body_mass, rtol=1e-4)


def changed(**values) -> Deployment:
    return replace(DEPLOYMENT, **values)


@pytest.mark.parametrize(
    ("attributes", "before", "after", "problem"),
    [
        ({"deployment": changed(default_pose=(0.0, 0.4))}, "", "", "has 2 angles, but its model has 1 act"),
        (
            {"deployment": changed(observation=DEPLOYMENT.observation[:2])},
            "",
            "",
            "4 numbers in .*, but its obs.* has 5",
        ),
        (
            {"deployment": changed(observation=(Term("gravity", (1.0, 2.0)), *DEPLOYMENT.observation[1:]))},
            "",
            "",
            "`gravity` in the `deployment` of `leg` has 2 scales for 3 numbers",
        ),
        (
            {"deployment": changed(observation=(Term("gravity", (1.0,)), *DEPLOYMENT.observation[1:]))},
            "",
            "",
            "`gravity` in the `deployment` of `leg` does not match what `observe` gives",
        ),
        (
            {"deployment": changed(observation=(*DEPLOYMENT.observation[:2], Term("joint_velocities", (0.2,))))},
            "",
            "",
            "`joint_velocities` in .* does not match what `observe` gives",
        ),
        ({"deployment": changed(action_scale=0.2)}, "", "", "`apply_action` of `leg` does not set default_pose"),
        ({}, 'kp="50"', 'kp="50" gear="5"', "The actuator hip of `leg` is not a position actuator of one joint with"),
        ({}, "position name", "motor name", "not a position actuator"),
        ({}, 'kp="50"', 'kp="50" timeconst="0.1"', "The actuator hip of `leg` filters its target"),
        ({}, 'kp="50"', 'kp="50" nsample="2" delay="0.005"', "is delayed"),
        ({}, 'forcerange="-20 20"', 'forcerange="-20 30"', "has a different force limit in each direction"),
        ({}, 'axis="0 1 0"', 'axis="0 1 0" actuatorfrcrange="-10 20"', "different force limit"),
        ({}, 'axis="0 1 0"', 'axis="0 1 0" type="slide"', "moves a joint that is not a hinge"),
        ({}, 'axis="0 1 0"', 'axis="0 1 0" stiffness="1 2"', "damping or stiffness that is not linear"),
        (
            {},
            '<position name="hip" joint="hip" kp="50" kv="1"',
            '<general name="hip" joint="hip" biastype="affine" gainprm="50" biasprm="5 -50 -1"',
            "has a constant force",
        ),
        ({}, '="hip"', '="hip,left"', "A joint or command of .* is called 'hip,left'"),
        ({"deployment": changed(commands=(("go,on", 0.0, 1.0),))}, "", "", "is called 'go,on'"),
        ({}, "<freejoint/>", '<joint name="up" type="slide" axis="0 0 1"/>', "no floating base"),
    ],
)
def test_a_deployment_that_is_not_the_task_s_is_one_sentence(
    leg: type[Leg], attributes, before: str, after: str, problem: str
):
    own = type("Leg", (leg,), attributes)
    text = LEG.replace(before, after) if before else LEG
    text = text.replace('kp="50" kv="1" ', "") if "<motor" in text else text
    (leg.folder / "leg.xml").write_text(text)
    with pytest.raises(TaskError, match=problem) as caught:
        export.deployed(policy(5, 1, (8,)), own)
    assert "\n" not in str(caught.value)


def test_a_policy_that_sees_a_part_of_a_term_is_one_sentence(wanted: Policy):
    with pytest.raises(TaskError, match="`unmeasured` of `anymal` hides only a part of `base_linear_velocity`"):
        export.deployed(replace(wanted, unseen=(0, 1)), Anymal)


def test_a_policy_is_kept_where_its_deployment_is_wrong(
    leg: type[Leg], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    own = type("Leg", (leg,), {"deployment": changed(action_scale=0.2)})
    monkeypatch.setattr(registry, "get", lambda env: own)
    (tmp_path / "best").mkdir()
    (tmp_path / "best" / "policy.safetensors").write_bytes(policy(5, 1, (8,)).to_bytes())
    assert "`apply_action` of `leg`" in build.policy_files(tmp_path, "best", "none", "leg")
    assert (tmp_path / "best" / "policy.onnx").exists() and not (tmp_path / "best" / "deploy.yaml").exists()


def test_a_refusal_leaves_no_file_of_before_beside_a_new_network(
    leg: type[Leg], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    own = [leg]
    monkeypatch.setattr(registry, "get", lambda env: own[0])
    (tmp_path / "best").mkdir()
    (tmp_path / "best" / "policy.safetensors").write_bytes(policy(5, 1, (8,)).to_bytes())
    assert build.policy_files(tmp_path, "best", "none", "leg") == ""
    made = {path.name for path in (tmp_path / "best").rglob("*") if path.is_file()}
    assert made == {"policy.safetensors", *export.PROGRAMS, "0_trunk.stl"}
    # A mesh that cannot be read now says nothing against files that were made when it could.
    (tmp_path / "shapes").rename(tmp_path / "gone")
    assert "trunk.stl" in build.policy_files(tmp_path, "best", "none", "leg")
    assert made == {path.name for path in (tmp_path / "best").rglob("*") if path.is_file()}
    (tmp_path / "gone").rename(tmp_path / "shapes")
    own[0] = type("Leg", (leg,), {"deployment": changed(action_scale=0.2)})
    assert "`apply_action` of `leg`" in build.policy_files(tmp_path, "best", "none", "leg")
    left = {path.name for path in (tmp_path / "best").rglob("*") if path.is_file()}
    assert left == {"policy.safetensors", "policy.onnx"}


class Stiffer(Leg):
    deployment = changed(action_scale=0.2)

    def apply_action(self, actions: torch.Tensor) -> None:
        self.ctrl[:] = 0.1 + 0.2 * actions


def test_a_policy_is_not_said_to_have_trained_with_what_was_changed_since(
    leg: type[Leg], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    now = [leg]
    monkeypatch.setattr(registry, "get", lambda env: now[0])
    trained = replace(policy(5, 1, (8,)), interface=as_text(described(leg)))
    (tmp_path / "best").mkdir()
    (tmp_path / "best" / "policy.safetensors").write_bytes(trained.to_bytes())
    assert build.policy_files(tmp_path, "best", "none", "leg") == ""
    before = {name: (tmp_path / "best" / name).read_bytes() for name in export.PROGRAMS}
    now[0] = type("Stiffer", (Stiffer,), {"model": leg.model})
    assert "`action_scale` of `leg` has changed since its policy" in build.policy_files(tmp_path, "best", "none", "leg")
    assert before == {name: (tmp_path / "best" / name).read_bytes() for name in export.PROGRAMS}
    now[0] = type("Slower", (leg,), {"control_dt": 0.04, "substeps": 8, "env": "renamed"})
    assert "`control_rate` of `renamed`" in build.policy_files(tmp_path, "best", "none", "leg")


def test_the_script_begins_where_a_drafted_task_does(leg: type[Leg], tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    key = '<keyframe><key qpos="0 0 3 0 0 0 1 0"/></keyframe></mujoco>'
    (leg.folder / "leg.xml").write_text(LEG.replace("</mujoco>", key))
    for name, content in export.deployed(policy(5, 1, (8,)), leg).items():
        (tmp_path / "best" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "best" / name).write_bytes(content)
    spec = importlib.util.spec_from_file_location("sim2sim", tmp_path / "best" / "sim2sim.py")
    assert spec is not None and spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    begun = []
    observe = script.Robot.state
    monkeypatch.setattr(script.Robot, "state", lambda self: begun.append(self.data.qpos.copy()) or observe(self))
    script.play(script.Controller(tmp_path / "best"), [], 0.02)
    np.testing.assert_allclose(begun[0], [0, 0, 3, 0, 0, 0, 1, 0.1], atol=1e-9)  # the joint at its default, 0.1 rad
