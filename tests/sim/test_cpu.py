from pathlib import Path

import mujoco
import numpy as np
import pytest
import torch

from openeureka.sim import CpuSimulator

DT = 0.01


def slider(gravity: float = 0.0) -> mujoco.MjModel:
    """A 2 kg body on a rail along x, pushed by a motor; a rod hinged to it makes the motion nonlinear."""
    spec = mujoco.MjSpec()
    spec.option.timestep = DT
    spec.option.gravity = [0, 0, gravity]
    cart = spec.worldbody.add_body(name="cart")
    cart.add_joint(name="slide", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0])
    cart.add_geom(size=[0.1, 0, 0], mass=2.0)
    if gravity:
        rod = cart.add_body(name="rod")
        rod.add_joint(name="hinge", axis=[0, 1, 0])
        rod.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[0, 0, 0, 0.3, 0, 0], size=[0.01, 0, 0])
    spec.add_actuator(name="push", target="slide", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    return spec.compile()


def test_fields_are_float32_with_a_world_axis():
    sim = CpuSimulator(slider(), 3, threads=1)
    for field, shape in {"qpos": (3, 1), "ctrl": (3, 1), "xpos": (3, 2, 3), "sensordata": (3, 0)}.items():
        tensor = sim.bind(field)
        assert tensor.shape == shape and tensor.dtype == torch.float32
        assert sim.bind(field) is tensor


def test_worlds_move_by_their_own_inputs():
    sim = CpuSimulator(slider(), 3, threads=1)
    qvel, ctrl = sim.bind("qvel"), sim.bind("ctrl")
    ctrl[:, 0] = torch.tensor([0.0, 1.0, -4.0])
    sim.step(1)
    # v = F / m * dt with m = 2 kg and dt = 0.01 s
    assert torch.allclose(qvel[:, 0], torch.tensor([0.0, 0.005, -0.02]))


def test_substeps_are_steps_under_constant_inputs():
    once, thrice = (CpuSimulator(slider(-9.81), 4, threads=1) for _ in range(2))
    for sim in (once, thrice):
        sim.bind("ctrl")[:, 0] = torch.arange(4.0)
    for _ in range(3):
        once.step(1)
    thrice.step(3)
    assert torch.equal(once.bind("qpos"), thrice.bind("qpos"))


def test_worlds_keep_double_precision_although_their_mirrors_do_not():
    model = slider(-9.81)
    sim = CpuSimulator(model, 2, threads=1)
    qpos = sim.bind("qpos")
    data = mujoco.MjData(model)
    for _ in range(200):
        sim.step(1)
        mujoco.mj_step(model, data)
    assert qpos[1].tolist() == data.qpos.astype(np.float32).tolist()


def test_derived_fields_are_current_after_step():
    sim = CpuSimulator(slider(), 2, threads=1)
    qpos, xpos = sim.bind("qpos"), sim.bind("xpos")
    sim.bind("ctrl")[:, 0] = 10.0
    for _ in range(5):
        sim.step(2)
        assert torch.equal(xpos[:, 1, 0], qpos[:, 0])
    assert float(qpos.min()) > 0.0


def test_written_state_is_taken_over_where_asked():
    sim = CpuSimulator(slider(), 3, threads=1)
    qpos, xpos = sim.bind("qpos"), sim.bind("xpos")
    qpos[:, 0] = torch.tensor([1.0, 2.0, 3.0])
    sim.forward(torch.tensor([0, 2]))
    assert xpos[:, 1, 0].tolist() == [1.0, 0.0, 3.0]


def test_a_partial_reset_leaves_the_other_worlds_bit_identical():
    sim = CpuSimulator(slider(-9.81), 4, threads=1)
    fields = {field: sim.bind(field) for field in ("qpos", "qvel", "ctrl", "xpos")}
    fields["ctrl"][:] = 3.0
    sim.step(20)
    before = {field: tensor.clone() for field, tensor in fields.items()}
    worlds, others = torch.tensor([1, 3]), torch.tensor([0, 2])
    sim.reset(worlds)
    sim.forward(worlds)
    for field, tensor in fields.items():
        assert torch.equal(tensor[others], before[field][others]), field
    for field in ("qpos", "qvel", "ctrl"):
        assert not fields[field][worlds].any(), field
    assert not fields["xpos"][worlds, 1].any()


def test_resetting_no_world_changes_nothing():
    sim = CpuSimulator(slider(), 2, threads=1)
    qpos = sim.bind("qpos")
    sim.bind("ctrl")[:] = 1.0
    sim.step(3)
    before = qpos.clone()
    none = torch.zeros(0, dtype=torch.int64)
    sim.reset(none)
    sim.forward(none)
    assert torch.equal(qpos, before)


def test_model_fields_can_differ_between_worlds_and_change_between_steps():
    sim = CpuSimulator(slider(), 3, threads=1)
    qvel, ctrl, mass = sim.bind("qvel"), sim.bind("ctrl"), sim.expand("body_mass")
    ctrl[:] = 4.0
    sim.step(1)
    mass[:, 1] = torch.tensor([1.0, 2.0, 4.0])
    sim.step(1)
    # v = 4 N * 0.01 s / 2 kg in the first step; 4 N * 0.01 s / m in the second
    assert torch.allclose(qvel[:, 0], torch.tensor([0.02 + 0.04, 0.02 + 0.02, 0.02 + 0.01]))
    model, _ = sim.snapshot(2)
    assert model.body_mass[1] == 4.0


def test_results_do_not_depend_on_the_number_of_threads():
    finals = []
    for threads in (1, 2, 5):
        sim = CpuSimulator(slider(-9.81), 7, threads=threads)
        sim.bind("ctrl")[:, 0] = torch.arange(7.0)
        qpos = sim.bind("qpos")
        for _ in range(50):
            sim.step(2)
        finals.append(qpos.clone())
    assert torch.equal(finals[0], finals[1]) and torch.equal(finals[0], finals[2])


@pytest.mark.parametrize("field", ["qpos", "qvel"])
def test_a_world_that_is_not_finite_is_reported_once_and_works_after_its_reset(field: str):
    sim = CpuSimulator(slider(-9.81), 3, threads=2)
    qpos, state, worlds = sim.bind("qpos"), sim.bind(field), torch.tensor([1])
    for _ in range(2):  # the same world may break again
        state[1] = torch.nan
        sim.forward(worlds)
        sim.step(2)
        assert sim.bad.tolist() == [False, True, False]
        sim.reset(worlds)
        sim.forward(worlds)
        sim.step(2)
        assert sim.bad.tolist() == [False, False, False]
        assert bool(qpos.isfinite().all())


def test_a_world_with_a_broken_input_is_reported():
    sim = CpuSimulator(slider(), 3, threads=1)
    ctrl = sim.bind("ctrl")
    ctrl[0] = torch.inf
    sim.step(1)
    assert sim.bad.tolist() == [True, False, False]


def test_broken_physics_writes_no_log_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    sim = CpuSimulator(slider(), 2, threads=1)
    sim.bind("qpos")[0] = torch.nan
    sim.forward(torch.tensor([0]))
    sim.step(1)
    assert bool(sim.bad[0])
    assert list(tmp_path.iterdir()) == []


def test_a_snapshot_is_one_world_as_plain_mujoco():
    sim = CpuSimulator(slider(), 2, threads=1)
    sim.bind("ctrl")[1] = 5.0
    sim.step(4)
    model, data = sim.snapshot(1)
    assert data.qpos.astype(np.float32).tolist() == sim.bind("qpos")[1].tolist()
    assert data.xpos[1, 0] == data.qpos[0] and model.nu == 1
