"""What every simulator must do. Inherit, open the simulator, and let pytest collect it:

class TestMySimulator(SimulatorConformance):
    def open(self, model: mujoco.MjModel, worlds: int) -> Simulator:
        return MySimulator(model, worlds)
"""

from __future__ import annotations

import mujoco
import torch

from openeureka.sim import Simulator
from openeureka.sim.base import MAX_SPEED

DT = 0.01
MASS = 2.0


def slider(gravity: float = 0.0) -> mujoco.MjModel:
    """A body of 2 kg on a rail along x, pushed by a motor; with gravity, a rod hinged to it makes the motion
    nonlinear."""
    spec = mujoco.MjSpec()
    spec.option.timestep = DT
    spec.option.gravity = [0, 0, gravity]
    cart = spec.worldbody.add_body(name="cart")
    cart.add_joint(name="slide", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0])
    cart.add_geom(size=[0.1, 0, 0], mass=MASS)
    if gravity:
        rod = cart.add_body(name="rod")
        rod.add_joint(name="hinge", axis=[0, 1, 0])
        rod.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[0, 0, 0, 0.3, 0, 0], size=[0.01, 0, 0])
    spec.add_actuator(name="push", target="slide", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    return spec.compile()


class SimulatorConformance:
    """Checks that hold for any simulator of MuJoCo models; its precision is a matter for its own tests."""

    def open(self, model: mujoco.MjModel, worlds: int) -> Simulator:
        """The simulator under test."""
        raise NotImplementedError

    def test_fields_are_float32_in_mujocos_shapes_with_a_world_axis(self) -> None:
        sim = self.open(slider(), 3)
        shapes = {"qpos": (3, 1), "ctrl": (3, 1), "xpos": (3, 2, 3), "xmat": (3, 2, 9), "sensordata": (3, 0)}
        for field, shape in shapes.items():
            tensor = sim.bind(field)
            assert tensor.shape == shape and tensor.dtype == torch.float32, field

    def test_worlds_move_by_their_own_inputs(self) -> None:
        sim = self.open(slider(), 3)
        qvel, ctrl = sim.bind("qvel"), sim.bind("ctrl")
        ctrl[:, 0] = torch.tensor([0.0, 1.0, -4.0])
        sim.step(1)
        # v = F / m * dt with m = 2 kg and dt = 0.01 s
        assert torch.allclose(qvel[:, 0].cpu(), torch.tensor([0.0, 0.005, -0.02]))

    def test_substeps_are_steps_under_constant_inputs(self) -> None:
        once, thrice = (self.open(slider(-9.81), 4) for _ in range(2))
        for sim in (once, thrice):
            sim.bind("ctrl")[:, 0] = torch.arange(4.0)
        for _ in range(3):
            once.step(1)
        thrice.step(3)
        assert torch.equal(once.bind("qpos"), thrice.bind("qpos"))

    def test_worlds_that_play_move_the_same_beside_others_that_need_not(self) -> None:
        some, whole = (self.open(slider(-9.81), 4) for _ in range(2))
        for sim in (some, whole):
            sim.bind("ctrl")[:, 0] = torch.arange(4.0)
            sim.step(1)
        some.playing = torch.tensor([True, False, True, False], device=some.device)
        for sim in (some, whole):
            sim.step(2)
        for field in ("qpos", "qvel", "xpos"):
            assert torch.equal(some.bind(field)[some.playing], whole.bind(field)[some.playing]), field
        some.playing = None
        moved = some.bind("qvel").clone()
        some.step(1)
        assert (some.bind("qvel") != moved).any(1).all()

    def test_derived_fields_are_current_after_step(self) -> None:
        sim = self.open(slider(), 2)
        qpos, xpos = sim.bind("qpos"), sim.bind("xpos")
        sim.bind("ctrl")[:, 0] = 10.0
        for _ in range(3):
            sim.step(2)
            assert torch.equal(xpos[:, 1, 0], qpos[:, 0])
        assert float(qpos.min()) > 0.0

    def test_written_state_is_taken_over_where_asked(self) -> None:
        sim = self.open(slider(), 3)
        qpos, xpos = sim.bind("qpos"), sim.bind("xpos")
        qpos[:, 0] = torch.tensor([1.0, 2.0, 3.0])
        sim.forward(torch.tensor([0, 2], device=sim.device))
        assert xpos[:, 1, 0].tolist() == [1.0, 0.0, 3.0]

    def test_a_partial_reset_by_index_or_mask_leaves_the_other_worlds_bit_identical(self) -> None:
        for worlds in (torch.tensor([1, 3]), torch.tensor([False, True, False, True])):
            sim = self.open(slider(-9.81), 4)
            fields = {field: sim.bind(field) for field in ("qpos", "qvel", "ctrl", "xpos", "qacc")}
            fields["ctrl"][:] = 3.0
            sim.step(20)
            before = {field: tensor.clone() for field, tensor in fields.items()}
            sim.reset(worlds.to(sim.device))
            sim.forward(worlds.to(sim.device))
            for field, tensor in fields.items():
                assert torch.equal(tensor[[0, 2]], before[field][[0, 2]]), field
            for field in ("qpos", "qvel", "ctrl"):
                assert not fields[field][[1, 3]].any(), field
            assert not fields["xpos"][[1, 3], 1].any()

    def test_resetting_no_world_changes_nothing(self) -> None:
        sim = self.open(slider(), 2)
        qpos = sim.bind("qpos")
        sim.bind("ctrl")[:] = 1.0
        sim.step(3)
        before = qpos.clone()
        none = torch.zeros(0, dtype=torch.int64, device=sim.device)
        sim.reset(none)
        sim.forward(none)
        assert torch.equal(qpos, before)

    def test_a_world_that_breaks_down_is_reported_once_and_works_after_its_reset(self) -> None:
        for field, value in (("qpos", torch.nan), ("qvel", torch.inf), ("qvel", 2.0 * MAX_SPEED), ("ctrl", torch.nan)):
            sim = self.open(slider(-9.81), 3)
            qpos, xpos, state = sim.bind("qpos"), sim.bind("xpos"), sim.bind(field)
            worlds = torch.tensor([1], device=sim.device)
            for _ in range(2):  # the same world may break again
                state[1] = value
                sim.forward(worlds)
                sim.step(2)
                assert sim.bad.tolist() == [False, True, False], field
                assert bool(xpos.isfinite().all()) and float(qpos[1].abs().max()) < 1.0, (
                    "rewards read these fields in this step, so they must not keep the broken values"
                )
                sim.reset(worlds)
                sim.forward(worlds)
                sim.step(2)
                assert sim.bad.tolist() == [False, False, False], field
                assert bool(qpos.isfinite().all())

    def test_model_fields_can_differ_between_worlds_and_change_between_steps(self) -> None:
        sim = self.open(slider(), 3)
        qvel, ctrl, mass = sim.bind("qvel"), sim.bind("ctrl"), sim.expand("body_mass")
        ctrl[:] = 4.0
        sim.step(1)
        mass[:, 1] = torch.tensor([1.0, 2.0, 4.0])
        sim.step(1)
        # v = 4 N * 0.01 s / 2 kg in the first step; 4 N * 0.01 s / m in the second
        assert torch.allclose(qvel[:, 0].cpu(), torch.tensor([0.02 + 0.04, 0.02 + 0.02, 0.02 + 0.01]))
        model, _ = sim.snapshot(2)
        assert model.body_mass[1] == 4.0

    def test_a_snapshot_is_one_world_as_plain_mujoco(self) -> None:
        sim = self.open(slider(), 2)
        sim.bind("ctrl")[1] = 5.0
        sim.step(4)
        model, data = sim.snapshot(1)
        assert torch.equal(torch.from_numpy(data.qpos).float(), sim.bind("qpos")[1].cpu())
        assert data.xpos[1, 0] == data.qpos[0] and model.nu == 1

    def test_another_simulator_goes_on_from_a_saved_state(self) -> None:
        first, second = (self.open(slider(-9.81), 3) for _ in range(2))
        for sim in (first, second):
            sim.bind("qpos")
            sim.bind("ctrl")
            sim.expand("body_mass")
        first.expand("body_mass")[:, 1] = torch.tensor([1.0, 2.0, 4.0])
        first.bind("ctrl")[:, 0] = 3.0
        first.step(5)
        second.load_state_dict(first.state_dict())
        for sim in (first, second):
            sim.step(5)
        assert len(first.bind("qpos")[:, 0].unique()) == 3  # three masses
        assert torch.equal(first.bind("qpos"), second.bind("qpos"))

    def test_the_first_step_from_a_saved_state_is_the_one_that_would_have_followed(self) -> None:
        first, second = (self.open(slider(-9.81), 3) for _ in range(2))
        for sim in (first, second):
            sim.bind("qpos")
            sim.bind("ctrl")
        first.bind("ctrl")[:, 0] = torch.tensor([0.0, 30.0, -60.0])
        first.step(20)
        second.load_state_dict(first.state_dict())
        for sim in (first, second):
            sim.step(1)
        assert len(first.bind("qpos")[:, 1].unique()) == 3  # the rods hang at three angles
        assert torch.equal(first.bind("qpos"), second.bind("qpos"))
