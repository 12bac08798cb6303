from pathlib import Path

import mujoco
import numpy as np
import pytest
import torch

from openeureka.sim import CpuSimulator, Simulator
from openeureka.testing.conformance.simulator import SimulatorConformance, slider


class TestCpuSimulator(SimulatorConformance):
    def open(self, model: mujoco.MjModel, worlds: int) -> Simulator:
        return CpuSimulator(model, worlds, threads=1)


def test_a_field_is_bound_once():
    sim = CpuSimulator(slider(), 3, threads=1)
    assert sim.bind("qpos") is sim.bind("qpos")


def test_worlds_keep_double_precision_although_their_mirrors_do_not():
    model = slider(-9.81)
    sim = CpuSimulator(model, 2, threads=1)
    qpos = sim.bind("qpos")
    data = mujoco.MjData(model)
    for _ in range(200):
        sim.step(1)
        mujoco.mj_step(model, data)
    assert qpos[1].tolist() == data.qpos.astype(np.float32).tolist()


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


def test_worlds_that_do_not_play_cost_nothing():
    sim = CpuSimulator(slider(-9.81), 3, threads=1)
    qpos = sim.bind("qpos")
    sim.bind("ctrl")[:, 0] = 1.0
    sim.step(5)
    before = qpos.clone()
    sim.playing = torch.tensor([False, True, False])
    sim.step(5)
    assert (qpos != before).any(1).tolist() == [False, True, False]
    assert not sim.bad.any()


def test_broken_physics_writes_no_log_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    sim = CpuSimulator(slider(), 2, threads=1)
    sim.bind("qpos")[0] = torch.nan
    sim.forward(torch.tensor([0]))
    sim.step(1)
    assert bool(sim.bad[0])
    assert list(tmp_path.iterdir()) == []


def test_all_cores_are_those_that_this_process_may_use():
    """Slurm and containers give a process only some of a machine's cores."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("openeureka.sim.cpu.usable_cores", lambda: 3)
        assert CpuSimulator(slider(), 5)._batch.nthread == 3
