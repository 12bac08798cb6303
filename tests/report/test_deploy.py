"""What runs a policy without openeureka: ANYmal's, as best/ holds it."""

import importlib.util
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
import yaml

from openeureka.errors import RewardFileError
from openeureka.report import export
from openeureka.suite.isaac.ant import Ant
from openeureka.suite.isaac.anymal import DEFAULT_ANGLES, Anymal
from openeureka.tasks import registry
from openeureka.training.policy import Player, Policy

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
    """On an observation of its own, under commands of four worlds, from the drop to the ground on."""
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
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, timeout=120)
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
    model.jnt_actfrclimited[2:4] = 1  # the first is the base's: these are the second and the third of the legs'
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
    assert "`ant` does not say what its observation is made of" in found["deploy.yaml"].decode()
    assert yaml.safe_load(found["deploy.yaml"]) == {"env": "ant"}


def test_a_policy_of_another_task_is_not_said_to_be_anymal_s():
    with pytest.raises(RewardFileError, match="none of a network for this task"):
        export.deployed(policy(60, 8, (8,)), Anymal)
