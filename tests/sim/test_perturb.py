import mujoco
import numpy as np
import pytest
import torch

from openeureka.sim import CpuSimulator, Simulator, open_simulator
from openeureka.sim.perturb import FACTORS, Perturbed, acts, scaled

SLED = """
<mujoco>
  <option timestep="0.01"/>
  <worldbody>
    <geom name="floor" type="plane" size="9 9 1" friction="0.5 0.005 0.0001"/>
    <body pos="0 0 0.1"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="2" friction="0.5 0.005 0.0001"/></body>
  </worldbody>
</mujoco>
"""
ARM = """
<mujoco>
  <option timestep="0.01" integrator="implicitfast"/>
  <worldbody>
    <geom type="plane" size="9 9 1" pos="0 0 -0.3"/>
    <body>
      <joint name="shoulder" type="hinge" axis="0 1 0" damping="0.3" armature="0.1"/>
      <geom type="capsule" size="0.05" fromto="0 0 0 0.4 0 0" mass="1"/>
      <body pos="0.4 0 0">
        <joint name="elbow" type="hinge" axis="0 1 0" damping="0.2" armature="0.1"/>
        <geom type="capsule" size="0.05" fromto="0 0 0 0.3 0 0" mass="1"/>
      </body>
    </body>
    <body pos="0 0.5 -0.252"><freejoint/><geom type="sphere" size="0.05" mass="1"/></body>
  </worldbody>
  <actuator>
    <position joint="shoulder" kp="30" kv="2" forcerange="-5 5"/>
    <motor joint="elbow" gear="3"/>
  </actuator>
</mujoco>
"""


def perturbed(sim: Simulator, **factors: list[float]) -> None:
    Perturbed(sim, factors).write(
        {name: torch.tensor(values) for name, values in factors.items()}, torch.ones(sim.num_worlds, dtype=torch.bool)
    )


def test_mass_and_inertia_are_scaled_for_the_worlds_that_ask_for_it():
    sim = CpuSimulator(mujoco.MjModel.from_xml_string(SLED), 4, threads=1)
    perturbed(sim, mass=[1.0, 1.0, 1.1, 1.1])
    sim.forward(torch.arange(4))
    assert sim.expand("body_mass")[:, 1].tolist() == pytest.approx([2.0, 2.0, 2.2, 2.2])
    model, _ = sim.snapshot(3)
    # A cube of side 0.2 m: inertia m a^2 / 6.
    assert model.body_inertia[1] == pytest.approx([2.2 * 0.04 / 6] * 3)


def test_a_body_on_slippery_ground_slides_further():
    sim = CpuSimulator(mujoco.MjModel.from_xml_string(SLED), 2, threads=1)
    qpos, qvel = sim.bind("qpos"), sim.bind("qvel")
    perturbed(sim, friction=[1.1, 0.9])
    qvel[:, 0] = 2.0
    sim.forward(torch.arange(2))
    for _ in range(200):
        sim.step(1)
    # Braked by mu g it slides v^2 / (2 mu g): 0.37 m with mu = 0.55, 0.45 m with 0.45.
    assert qpos[:, 0].tolist() == pytest.approx([0.37, 0.45], abs=0.03)
    assert float(qpos[1, 0] - qpos[0, 0]) > 0.05


def test_strength_and_friction_scale_every_limit_and_every_contact_that_a_model_has():
    text = ARM.replace('name="elbow"', 'name="elbow" actuatorfrcrange="-4 4"').replace(
        "<actuator>", '<contact><pair geom1="ground" geom2="ball" friction="0.5 0.5 0.1 0.1 0.1"/></contact><actuator>'
    )
    text = text.replace('<geom type="plane"', '<geom name="ground" type="plane"').replace(
        '<geom type="sphere"', '<geom name="ball" type="sphere"'
    )
    sim = CpuSimulator(mujoco.MjModel.from_xml_string(text), 2, threads=1)
    perturbed(sim, strength=[1.0, 0.5], friction=[1.0, 2.0])
    sim.forward(torch.arange(2))
    changed, _ = sim.snapshot(1)
    assert changed.jnt_actfrcrange[1].tolist() == [-2.0, 2.0] and changed.actuator_forcerange[0].tolist() == [-2.5, 2.5]
    assert changed.pair_friction[0].tolist() == pytest.approx([1.0, 1.0, 0.2, 0.2, 0.2])
    assert sim.snapshot(0)[0].pair_friction[0, 0] == 0.5


def test_fields_that_nobody_changes_stay_shared_and_worlds_that_nobody_names_stay_exact():
    sim = CpuSimulator(mujoco.MjModel.from_xml_string(ARM), 2, threads=1)
    asked: list[str] = []
    expand = sim.expand
    sim.expand = lambda field: (asked.append(field), expand(field))[1]
    Perturbed(sim, ["mass"]).write({"mass": torch.tensor([2.0, 2.0])}, torch.tensor([True, False]))
    assert set(asked) == {"body_mass", "body_inertia"}
    sim.step(1)
    exact = sim.memory()["exact/body_inertia"].numpy()
    assert (exact[1] == sim.model.body_inertia).all() and exact[0] == pytest.approx(2.0 * sim.model.body_inertia)


def test_each_factor_scales_what_it_names():
    model = mujoco.MjModel.from_xml_string(ARM)
    assert all(acts(model, factor) for factor in FACTORS)
    # The shoulder's drive: gain 30, bias 0, -30, -2. The elbow's motor has gain 1 and no bias.
    entries = {
        factor: {field: np.argwhere(mask).tolist() for field, mask in scaled(model, factor).items()}
        for factor in ("strength", "stiffness", "drive_damping")
    }
    assert entries["stiffness"] == {"actuator_gainprm": [[0, 0]], "actuator_biasprm": [[0, 1]]}
    assert entries["drive_damping"] == {"actuator_gainprm": [], "actuator_biasprm": [[0, 2]]}
    assert entries["strength"]["actuator_gainprm"] == [[0, 0], [1, 0]]
    assert entries["strength"]["actuator_forcerange"] == [[0, 0], [0, 1]]
    sled = mujoco.MjModel.from_xml_string(SLED)
    assert [factor for factor in FACTORS if acts(sled, factor)] == ["mass", "inertia", "friction", "gravity"]


MUSCLES = ARM.replace('<position joint="shoulder" kp="30" kv="2" forcerange="-5 5"/>', "").replace(
    '<motor joint="elbow" gear="3"/>',
    """<muscle name="said" joint="shoulder" lengthrange="0.5 1.5" force="300"/>
       <muscle name="scaled" joint="elbow" lengthrange="0.5 1.5" scale="200"/>""",
)


def test_muscles_are_stronger_in_whole_and_have_no_stiffness_of_drives():
    model = mujoco.MjModel.from_xml_string(MUSCLES)
    assert not acts(model, "stiffness") and not acts(model, "drive_damping")
    sim = CpuSimulator(model, 2, threads=1)
    ctrl, force, qpos = sim.bind("ctrl"), sim.bind("actuator_force"), sim.bind("qpos")
    perturbed(sim, strength=[1.0, 1.4])
    qpos[:, :2] = 2.0  # so far that both muscles are stretched and pull passively
    sim.forward(torch.arange(2))
    for excited in (0.0, 1.0):
        ctrl[:] = excited
        for _ in range(2):
            sim.step(1)
        strong = force[1] / force[0]
        assert strong.tolist() == pytest.approx([1.4, 1.4], rel=0.02)


def test_a_weak_drive_gives_less_at_its_limit_and_below_it():
    sim = CpuSimulator(mujoco.MjModel.from_xml_string(ARM), 4, threads=1)
    ctrl, force = sim.bind("ctrl"), sim.bind("actuator_force")
    perturbed(sim, strength=[1.0, 0.5, 0.5, 1.0], stiffness=[1.0, 1.0, 1.0, 0.5])
    sim.forward(torch.arange(4))
    ctrl[:, 0] = torch.tensor([1.0, 1.0, 0.1, 0.1])
    sim.step(1)
    # kp * ctrl: 30 N m is limited to 5, or to 2.5; 3 N m becomes 1.5 with half the strength or half the stiffness.
    assert force[:, 0].tolist() == pytest.approx([5.0, 2.5, 1.5, 1.5])


def test_every_factor_does_the_same_on_warp():
    pytest.importorskip("mujoco_warp", reason="pip install 'openeureka[gpu]'")
    model = mujoco.MjModel.from_xml_string(ARM)
    worlds = len(FACTORS) + 1  # one factor is changed in each world but the last
    factors = {name: [1.5 if i == k else 1.0 for i in range(worlds)] for k, name in enumerate(FACTORS)}
    ends: list[torch.Tensor] = []
    for device in ("cpu", "warp-cpu"):
        sim = open_simulator(model, worlds, device=device, threads=1)
        qpos, qvel, ctrl = (sim.bind(field) for field in ("qpos", "qvel", "ctrl"))
        perturbed(sim, **factors)
        qvel[:, 0], qvel[:, 2] = 1.0, 0.5  # the ball slides
        sim.forward(torch.arange(worlds))
        ctrl[:, 0], ctrl[:, 1] = 0.1, 0.3
        for _ in range(5):
            sim.step(1)
        ends.append(torch.cat((qpos, qvel), dim=1).clone())
    torch.testing.assert_close(ends[0], ends[1], atol=1e-4, rtol=1e-4)
    assert all(float((ends[0][i] - ends[0][-1]).abs().max()) > 1e-3 for i in range(len(FACTORS)))
