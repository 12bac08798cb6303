import json

from openeureka.cli.tasks import context, envs
from openeureka.method import baselines
from openeureka.tasks import registry


def test_envs_lists_every_task_suite_by_suite(capsys, monkeypatch):
    monkeypatch.setattr(registry, "names", lambda: ["cartpole", "shadow_hand_over", "ant", "shadow_hand_pen"])
    envs()
    lines = [line.split() for line in capsys.readouterr().out.splitlines() if line and not line.startswith("    ")]
    assert [line[:4] for line in lines[1:7]] == [
        ["isaac"],
        ["cartpole", "4", "1", "500"],
        ["ant", "60", "8", "1000"],
        ["dexterity"],
        ["shadow_hand_over", "398", "40", "75"],
        ["shadow_hand_pen", "417", "52", "125"],
    ]


def test_the_list_of_tasks_fits_a_terminal_of_80_columns(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    envs()
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    words = " ".join(text.split())
    assert all(registry.get(name).description in words for name in registry.names())


def test_envs_shows_measured_baselines(capsys, monkeypatch):
    both = {"human": {"training": [9.0], "held_out": {"fitness": [7.0, 9.5], "reward": [0.0, 0.0]}},
            "sparse": {"training": [5.0], "held_out": {"fitness": [None, 3.0], "reward": [4.0, 5.0]}}}  # fmt: skip
    ant = {**both, "env_steps": 10, "worlds": 1, "device": "a GPU", "date": "2026-01-01"}
    monkeypatch.setattr(baselines, "_shipped", lambda: {"ant": ant})
    envs()
    rows = {line.split()[0]: line.split() for line in capsys.readouterr().out.splitlines() if line}
    assert rows["ant"][4:6] == ["8.25", "4.5"]  # of the two policies, the better one, as in a run
    assert rows["cartpole"][4:6] == ["-", "-"]


def test_context_shows_the_state_and_hides_the_fitness(capsys):
    context(["env=cartpole"])
    text = capsys.readouterr().out
    assert "pole_angle     Tensor (N)     pole angle from upright [rad]" in text
    assert "def compute_state" in text and "fitness" not in text
    assert "The task score: steps the pole stays up, from 0 to 499; higher is better." in text
    assert "MAX_FORCE" not in text and "An episode has at most 499 steps" in text and "`pole_angle` -0." in text


def test_the_list_of_tasks_is_json_for_programs(capsys, monkeypatch):
    monkeypatch.setattr(registry, "names", lambda: ["cartpole"])
    envs(as_json=True)
    found = json.loads(capsys.readouterr().out)["cartpole"]
    assert (found["suite"], found["observations"], found["actions"], found["episode_length"]) == ("isaac", 4, 1, 500)
    assert found["human_fitness"] == 499.0  # 402.9 at the peak of F: one of three policies fails
