import sys
from types import SimpleNamespace

import mujoco
import pytest
import torch

from openeureka import sim
from openeureka.errors import ConfigError
from openeureka.sim import check_device
from openeureka.sim.base import Capacity, capacity
from openeureka.tasks.registry import get, make


def test_room_is_guessed_from_the_model():
    # 13 geoms may touch the floor: 16 + 4 * 13 contacts of 4 rows, and 8 joint limits.
    assert capacity(get("ant").compile_model(), Capacity()) == Capacity(68, 8 + 4 * 68)
    assert capacity(get("ant").compile_model(), Capacity(constraints=50)) == Capacity(68, 50)


def test_room_is_guessed_from_the_larger_condim_of_what_touches():
    def room(floor: int, *, pair: int = 0, solid: int = 1) -> Capacity:
        spec = mujoco.MjSpec()
        spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[9, 9, 1], condim=floor)
        ball = spec.worldbody.add_body()
        ball.add_freejoint()
        ball.add_geom(name="ball", size=[0.1, 0, 0], condim=3, contype=solid, conaffinity=solid)
        if pair:
            spec.add_pair(geomname1="floor", geomname2="ball", condim=pair)
        return capacity(spec.compile(), Capacity())

    # 16 + 4 contacts of 2 * (condim - 1) rows
    assert room(3) == Capacity(20, 20 * 4)
    assert room(6) == Capacity(20, 20 * 10)
    assert room(3, pair=4) == Capacity(20, 20 * 6)
    # 16 contacts, with one row each if nothing that moves can touch anything
    assert room(6, solid=0) == Capacity(16, 16)
    assert room(6, solid=0, pair=3) == Capacity(16, 16 * 4)


def test_a_device_that_does_not_exist_is_one_sentence(monkeypatch: pytest.MonkeyPatch):
    with pytest.raises(ConfigError, match=r"no device `gpu`; `device` takes cpu, cuda"):
        check_device("gpu")
    monkeypatch.setattr(sim, "find_spec", lambda _: object())
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    with pytest.raises(ConfigError, match="device=cuda needs an NVIDIA GPU"):
        make("cartpole", worlds=1, device="cuda")
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    monkeypatch.setattr(sim, "_warp_gpus", lambda: 2)
    check_device("cuda:1")
    with pytest.raises(ConfigError, match="no device cuda:2: torch sees 2 GPUs"):
        check_device("cuda:2")
    monkeypatch.setattr(sim, "find_spec", lambda _: None)
    with pytest.raises(ConfigError, match="device=warp-cpu needs MuJoCo Warp"):
        check_device("warp-cpu")


@pytest.mark.parametrize(("usable", "said"), [(0, "none"), (1, "1")])
def test_a_driver_that_is_too_old_for_warp_is_one_sentence(monkeypatch: pytest.MonkeyPatch, usable: int, said: str):
    old = SimpleNamespace(config=SimpleNamespace(), LOG_ERROR=40, get_cuda_device_count=lambda: usable)
    monkeypatch.setitem(sys.modules, "warp", old)
    monkeypatch.setattr(sim, "find_spec", lambda _: object())
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    with pytest.raises(
        ConfigError, match=rf"newer NVIDIA driver: .*torch sees 2 GPUs, but MuJoCo Warp can use {said}; update"
    ):
        check_device("cuda")
    check_device("warp-cpu")
