"""The GPU benchmark, on the CPU: what it measures, and that an interrupted run goes on where it stopped."""

import json
import os
from collections.abc import Iterator
from typing import Any

import gpu
import gpu_parts as parts
import pytest

from openeureka.errors import CapacityError
from openeureka.tasks import registry
from openeureka.types import Evaluation

ENV = "cartpole"


@pytest.fixture
def sizes() -> Any:
    return gpu.Sizes(worlds=4, lanes=(1, 2, 3), measure=0.05, train=0.1, parity_steps=2)


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Replaces the parts by fakes that answer at once, and lists their calls. To train three lanes in three processes
    fails."""
    called: list[str] = []

    def part(name: str, rate: int = 0):
        def run(env: str, device: str, sizes: Any, *extra: Any) -> dict[str, Any]:
            called.append(" ".join([name, env, *map(str, extra)]))
            if extra == (3, 3):
                raise RuntimeError("out of memory")
            return {"steps_per_second": rate} if rate else {"differences": [{"variable": "x", "worst": 0.0}]}

        return run

    rates = {"parity": 0, "raw": 1000, "environment": 800, "training": 500, "epoch": 1, "human": 7}
    for name, rate in rates.items():
        monkeypatch.setattr(gpu, name, part(name, rate))
    monkeypatch.setattr(gpu, "_isolated", lambda part, *arguments: part(*arguments))
    return called


def test_every_kind_of_part_is_run_for_every_task(sizes, fake, tmp_path, capsys):
    gpu.run("cpu", ["ant", ENV], gpu.KINDS, sizes, tmp_path / "gpu.json", again=False)
    assert fake[:4] == ["parity ant", "parity cartpole", "raw ant", "raw cartpole"]
    of_ant = [call for call in fake if " ant" in call]
    assert of_ant == [
        "parity ant",
        "raw ant",
        "environment ant",
        *(f"training ant {lanes} 1" for lanes in (1, 2, 3)),
        "training ant 3 3",
        "epoch ant",
        "human ant 500",
    ]
    found = json.loads((tmp_path / "gpu.json").read_text())
    assert found["parts"]["processes/ant/3"]["error"] == "RuntimeError: out of memory"
    assert gpu.rows(found)[0] == ["`ant`", "1,000", "800", "500", "", "", "", ""], "1 lane is measured, 4 and 16 not"
    assert "\n`ant` | 1,000 | 800 | 500 |" in capsys.readouterr().out
    assert found["machine"]["device"] == "cpu" and found["date"]


def test_a_run_goes_on_with_what_is_missing_or_failed(sizes, fake, tmp_path):
    out = tmp_path / "gpu.json"
    gpu.run("cpu", ["ant"], ["raw", "processes"], sizes, out, again=False)
    fake.clear()
    gpu.run("cpu", ["ant"], ["raw", "env", "processes"], sizes, out, again=False)
    assert fake == ["environment ant", "training ant 3 3"]
    fake.clear()
    gpu.run("cpu", ["ant"], ["raw"], sizes, out, again=True)
    assert fake == ["raw ant"]
    assert set(json.loads(out.read_text())["parts"]) == {"raw/ant", "env/ant", "processes/ant/3"}


def test_the_human_part_measures_the_rate_it_needs(sizes, fake, tmp_path):
    gpu.run("cpu", ["ant"], ["human"], sizes, tmp_path / "gpu.json", again=False)
    assert fake == ["training ant 2 1", "human ant 500"]


def test_rates_of_different_sizes_are_not_mixed(sizes, fake, tmp_path):
    gpu.run("cpu", ["ant"], ["raw"], sizes, tmp_path / "gpu.json", again=False)
    bigger = gpu.Sizes(worlds=8, lanes=(1, 2, 3), measure=0.05, train=0.1, parity_steps=2)
    with pytest.raises(SystemExit, match="name another file"):
        gpu.run("cpu", ["ant"], ["env"], bigger, tmp_path / "gpu.json", again=False)


def test_rates_of_different_machines_are_not_mixed(sizes, fake, tmp_path, monkeypatch):
    out, names = tmp_path / "gpu.json", {"cuda:0": "one kind", "cuda:1": "one kind", "cuda:2": "another"}
    monkeypatch.setattr(gpu, "machine", lambda device: {"device": device, "gpu": names[device]})
    gpu.run("cuda:0", ["ant"], ["raw"], sizes, out, again=False)
    gpu.run("cuda:1", ["ant"], ["env"], sizes, out, again=False)
    before = out.read_text()
    with pytest.raises(SystemExit, match="was measured on one kind; name another file"):
        gpu.run("cuda:2", ["ant"], ["epoch"], sizes, out, again=False)
    with pytest.raises(SystemExit, match="Nothing can be measured on cuda:9"):
        gpu.run("cuda:9", ["ant"], ["epoch"], sizes, out, again=False)
    monkeypatch.setattr(gpu, "machine", lambda device: {"device": device})
    with pytest.raises(SystemExit, match="was measured on one kind; name another file"):
        gpu.run("warp-cpu", ["ant"], ["epoch"], sizes, out, again=False)
    assert out.read_text() == before


def test_a_part_that_takes_its_process_down_is_an_error_of_that_part():
    found = gpu.attempt(os._exit, 1)
    assert found["error"].startswith("BrokenProcessPool")
    assert found["seconds"] > 0.0


def test_simulation_is_measured(sizes):
    parity = parts.parity(ENV, "cpu", sizes)
    assert max(found["worst"] for found in parity["differences"]) < 1e-4  # the CPU compared with itself
    raw, environment = parts.raw(ENV, "cpu", sizes), parts.environment(ENV, "cpu", sizes)
    assert raw["worlds"] == environment["worlds"] == 12  # three lanes of four worlds
    assert raw["steps_per_second"] > 0 and environment["steps_per_second"] > 0
    assert environment["broken_worlds"] == 0


@pytest.mark.parametrize("part", ["raw", "environment"])
def test_a_rate_of_physics_that_lacked_room_is_an_error(sizes, monkeypatch, part):
    pytest.importorskip("mujoco_warp", reason="pip install 'openeureka[gpu]'")
    monkeypatch.setattr(registry.get("ballbalance"), "max_constraints", 4)  # the pins of its feet alone take nine
    monkeypatch.setattr(parts, "RAW_EPISODE", 2)
    with pytest.raises(CapacityError, match="4 constraints per world"):
        getattr(parts, part)("ballbalance", "warp-cpu", sizes)


def test_trainings_are_measured(sizes):
    programs = parts.rewards(ENV, 3)
    assert len({str(program) for program in programs}) == 3
    found = parts.training(ENV, "cpu", sizes, lanes=2, processes=2)
    assert found["worlds"] == 8 and found["steps_per_second"] > 0
    assert found["nodes_per_reward"] == sum(len(program.nodes) for program in programs[:2]) / 2


def test_the_human_reward_is_trained_for_a_time_and_scored(sizes, monkeypatch):
    def evaluate(self: Any, env: str, policies: dict[str, bytes], *, seed: int) -> Iterator[Evaluation]:
        return (Evaluation(lane=lane, fitness=8.5, episode_length=9.0, episodes=1) for lane in policies)

    monkeypatch.setattr(parts.LocalExecutor, "evaluate", evaluate)  # the real one plays 256 worlds for 500 steps
    found = parts.human(ENV, "cpu", sizes, rate=2 * 4 * 16 * 3 / 0.1)  # three epochs of two lanes
    assert set(found["lanes"]) == {"human-s0", "human-s1"}
    assert found["lanes"]["human-s0"]["env_steps"] == 3 * 4 * 16
    assert found["lanes"]["human-s1"]["held_out_at_peak_of_reward"]["fitness"] == 8.5
    assert "of training" in gpu.line("human/cartpole", found)


def test_an_epoch_is_taken_apart(sizes):
    found = parts.epoch(ENV, "cpu", sizes)
    assert found["seconds_of_an_epoch"] > 0 and found["steps"] == 16
    assert (found["seconds_of_the_device"], found["waits"]) == (0, 0), "there is no other device to wait for"
    assert "waits 0 times" in gpu.line("epoch/cartpole/3", found)
