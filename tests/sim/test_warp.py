"""MuJoCo Warp on its CPU device; kernels are compiled in the first run and kept in warp's cache (WARP_CACHE_PATH)."""

import pytest
import torch
from test_cpu import slider

from openeureka.errors import TaskError
from openeureka.sim import open_simulator
from openeureka.sim.base import Simulator
from openeureka.sim.capacity import Capacity
from openeureka.tasks.registry import get, make

pytest.importorskip("mujoco_warp", reason="pip install 'openeureka[gpu]'")
pytestmark = pytest.mark.timeout(900)  # a minute of compilation on a quiet machine

ROOM = Capacity(contacts=4, constraints=8)


def simulator(worlds: int, gravity: float = 0.0) -> Simulator:
    return open_simulator(slider(gravity), worlds, device="warp-cpu", room=ROOM)


def test_worlds_move_by_their_own_inputs():
    sim = simulator(3)
    qvel, ctrl = sim.bind("qvel"), sim.bind("ctrl")
    ctrl[:, 0] = torch.tensor([0.0, 1.0, -4.0])
    sim.step(1)
    # v = F / m * dt with m = 2 kg and dt = 0.01 s
    assert torch.allclose(qvel[:, 0], torch.tensor([0.0, 0.005, -0.02]))


def test_fields_have_mujocos_own_shapes():
    sim = simulator(2)
    for field, shape in {"qpos": (2, 1), "xpos": (2, 2, 3), "xmat": (2, 2, 9), "sensordata": (2, 0)}.items():
        assert sim.bind(field).shape == shape and sim.bind(field).dtype == torch.float32


def test_derived_fields_are_current_after_step():
    sim = simulator(2)
    qpos, xpos = sim.bind("qpos"), sim.bind("xpos")
    sim.bind("ctrl")[:, 0] = 10.0
    for _ in range(3):
        sim.step(2)
        assert torch.equal(xpos[:, 1, 0], qpos[:, 0])
    assert float(qpos.min()) > 0.0


@pytest.mark.parametrize("worlds", [torch.tensor([1, 3]), torch.tensor([False, True, False, True])])
def test_a_partial_reset_leaves_the_other_worlds_bit_identical(worlds: torch.Tensor):
    sim = simulator(4, gravity=-9.81)
    fields = {field: sim.bind(field) for field in ("qpos", "qvel", "ctrl", "xpos", "qacc")}
    fields["ctrl"][:] = 3.0
    sim.step(20)
    before = {field: tensor.clone() for field, tensor in fields.items()}
    chosen, others = torch.tensor([1, 3]), torch.tensor([0, 2])
    sim.reset(worlds)
    sim.forward(worlds)
    for field, tensor in fields.items():
        assert torch.equal(tensor[others], before[field][others]), field
    for field in ("qpos", "qvel", "ctrl"):
        assert not fields[field][chosen].any(), field
    assert not fields["xpos"][chosen, 1].any()


@pytest.mark.parametrize(("field", "value"), [("qpos", torch.nan), ("qvel", torch.inf), ("ctrl", torch.nan)])
def test_a_world_that_is_not_finite_is_reported_once_and_works_after_its_reset(field: str, value: float):
    sim = simulator(3, gravity=-9.81)
    qpos, xpos, state, worlds = sim.bind("qpos"), sim.bind("xpos"), sim.bind(field), torch.tensor([1])
    for _ in range(2):  # the same world may break again
        state[1] = value
        sim.forward(worlds)
        sim.step(2)
        assert sim.bad.tolist() == [False, True, False]
        assert bool(qpos.isfinite().all() and xpos.isfinite().all()), "what a reward reads in this step"
        sim.reset(worlds)
        sim.forward(worlds)
        sim.step(2)
        assert sim.bad.tolist() == [False, False, False]
        assert bool(qpos.isfinite().all())


def test_model_fields_can_differ_between_worlds_and_change_between_steps():
    sim = simulator(3)
    qvel, ctrl, mass = sim.bind("qvel"), sim.bind("ctrl"), sim.expand("body_mass")
    ctrl[:] = 4.0
    sim.step(1)
    mass[:, 1] = torch.tensor([1.0, 2.0, 4.0])
    sim.step(1)
    # v = 4 N * 0.01 s / 2 kg in the first step; 4 N * 0.01 s / m in the second
    assert torch.allclose(qvel[:, 0], torch.tensor([0.02 + 0.04, 0.02 + 0.02, 0.02 + 0.01]))
    model, _ = sim.snapshot(2)
    assert model.body_mass[1] == 4.0


def test_a_snapshot_is_one_world_as_plain_mujoco():
    sim = simulator(2)
    sim.bind("ctrl")[1] = 5.0
    sim.step(4)
    model, data = sim.snapshot(1)
    assert torch.allclose(torch.from_numpy(data.qpos).float(), sim.bind("qpos")[1])
    assert data.xpos[1, 0] == data.qpos[0] and model.nu == 1


def test_a_lack_of_room_is_an_error_that_names_the_setting(monkeypatch: pytest.MonkeyPatch):
    ballbalance = get("ballbalance")
    monkeypatch.setattr(ballbalance, "max_constraints", 4)  # the pins of its feet are nine rows
    simulation = make("ballbalance", worlds=2, device="warp-cpu")
    simulation.reset()
    simulation.step(torch.zeros(2, 3))
    with pytest.raises(TaskError, match="4 constraints a world.*raise `max_constraints`"):
        simulation.check()


@pytest.mark.parametrize("device", ["cpu", "warp-cpu"])
def test_another_simulator_goes_on_from_a_saved_state(device: str):
    first, second = (open_simulator(slider(-9.81), 3, device=device, room=ROOM) for _ in range(2))
    for sim in (first, second):
        sim.bind("qpos"), sim.bind("ctrl"), sim.expand("body_mass")
    first.expand("body_mass")[:, 1] = torch.tensor([1.0, 2.0, 4.0])
    first.bind("ctrl")[:, 0] = 3.0
    first.step(5)
    second.load_state_dict(first.state_dict())
    for sim in (first, second):
        sim.step(5)
    assert len(first.bind("qpos")[:, 0].unique()) == 3  # three masses
    assert torch.equal(first.bind("qpos"), second.bind("qpos"))
