"""The Shadow Hand as a part of any scene."""

import warnings

import mujoco
import pytest

from openeureka.suite.shadow import COUPLINGS, FINGERTIPS, add_shadow_hand

FINGERS = {"FF": (3, 2, 1), "MF": (3, 2, 1), "RF": (3, 2, 1), "LF": (4, 3, 2, 1), "TH": (4, 3, 2, 1, 0)}
ACTUATED = ["WRJ1", "WRJ0", *(f"{finger}J{i}" for finger, joints in FINGERS.items() for i in joints)]
PASSIVE = {"FFJ1": "FFJ0", "MFJ1": "MFJ0", "RFJ1": "RFJ0", "LFJ1": "LFJ0"}


@pytest.fixture
def one() -> mujoco.MjModel:
    scene = mujoco.MjSpec()
    add_shadow_hand(scene, "h_", pos=[0, 0, 0.5])
    scene.option.timestep = 0.005
    scene.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return scene.compile()


def test_joints_and_drives_come_in_the_order_of_the_specification(one: mujoco.MjModel):
    joints = [name for drive in ACTUATED for name in (drive, PASSIVE.get(drive)) if name]
    assert [one.joint(i).name for i in range(one.njnt)] == [f"h_{name}" for name in joints]
    assert [one.joint(int(i)).name for i in one.actuator_trnid[:, 0]] == [f"h_{name}" for name in ACTUATED]
    assert one.actuator_gainprm[:, 0].tolist() == [5, 5] + [1] * 18
    assert one.dof_damping.tolist() == pytest.approx([0.5, 0.5] + [0.1] * 22)
    assert one.actuator_forcerange[:5, 1].tolist() == pytest.approx([4.785, 2.175, 0.9, 0.9, 0.7245])
    assert one.actuator_ctrlrange == pytest.approx(one.jnt_range[one.actuator_trnid[:, 0]])


def test_masses_bodies_and_contacts(one: mujoco.MjModel):
    # mount 0.1, forearm 4, wrist and palm 0.3, metacarpal 0.075, four fingers of 0.044, thumb 0.06
    assert one.body_mass.sum() == pytest.approx(0.1 + 4 + 0.3 + 0.3 + 0.075 + 4 * 0.044 + 0.06)
    assert (one.nbody - 1, one.nv, one.nu, one.npair, one.nsensor) == (26, 24, 20, 19, 0)
    assert [one.tendon(i).name for i in range(one.ntendon)] == [f"h_{name}" for name in COUPLINGS]
    colliding = [one.geom(i).name for i in range(one.ngeom) if one.geom_contype[i]]
    assert all(name.startswith("h_C_") for name in colliding) and len(colliding) == 20
    assert not one.geom_conaffinity.any(), "hands meet each other and themselves in the listed pairs only"


def test_the_palm_faces_up_and_the_fingers_point_along_minus_y(one: mujoco.MjModel):
    data = mujoco.MjData(one)
    mujoco.mj_forward(one, data)
    assert data.body("h_wrist").xpos == pytest.approx([0, -0.256, 0.49], abs=1e-5)
    assert data.body("h_palm").xpos == pytest.approx([0, -0.29, 0.49], abs=1e-5)
    tips = [data.body(f"h_{tip}").xpos for tip in FINGERTIPS]
    assert [tip[1] for tip in tips[:3]] == pytest.approx([-0.455, -0.459, -0.455], abs=1e-4)
    assert -data.body("h_palm").xmat.reshape(3, 3)[:, 1] == pytest.approx([0, 0, 1], abs=1e-5)


def test_it_floats_where_it_is_put_and_the_last_finger_joints_follow(one: mujoco.MjModel):
    data = mujoco.MjData(one)
    data.actuator("h_A_FFJ1").ctrl = 1.2
    mujoco.mj_step(one, data, 1000)
    assert data.joint("h_FFJ1").qpos[0] == pytest.approx(1.2, abs=0.05)
    # The tendon keeps 0.00705 q0 - 0.00805 q1 within 0.001, or a little more while it pulls.
    assert abs(0.00705 * data.joint("h_FFJ0").qpos[0] - 0.00805 * data.joint("h_FFJ1").qpos[0]) < 0.0012
    still = [joint for joint in ACTUATED if joint != "FFJ1"]
    assert max(abs(data.joint(f"h_{joint}").qpos[0]) for joint in still) < 1e-3, "no gravity on the hand"


def test_two_hands_share_a_scene_without_a_warning():
    scene = mujoco.MjSpec()
    scene.option.iterations, scene.option.impratio, scene.option.timestep = 20, 10, 0.005
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        add_shadow_hand(scene, "right_", pos=[0, 0, 0.5])
        # Half a turn about the vertical: the second hand faces the first.
        add_shadow_hand(scene, "left_", pos=[0, -1, 0.5], quat=[0, 0, 0, 1]).add_freejoint(name="left_base")
        model = scene.compile()
    assert (model.nv, model.nu, model.npair, model.ntendon) == (24 + 30, 40, 38, 8)
    assert (model.opt.iterations, model.opt.impratio, model.opt.timestep) == (20, 10, 0.005)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.body("left_palm").xpos == pytest.approx([0, -1 + 0.29, 0.49], abs=1e-5)
