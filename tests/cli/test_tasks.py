from openeureka import baselines
from openeureka.cli.tasks import context, envs
from openeureka.tasks import registry


def test_envs_lists_every_task_suite_by_suite(capsys, monkeypatch):
    monkeypatch.setattr(registry, "names", lambda: ["cartpole", "shadow_hand_over", "ant", "shadow_hand_pen"])
    envs()
    rows = [line.split()[:5] for line in capsys.readouterr().out.split("\n\n")[0].splitlines()[1:]]
    assert rows == [
        ["cartpole", "isaac", "4", "1", "500"],
        ["ant", "isaac", "60", "8", "1000"],
        ["shadow_hand_over", "dexterity", "398", "40", "75"],
        ["shadow_hand_pen", "dexterity", "417", "52", "125"],
    ]


def test_envs_shows_measured_baselines(capsys, monkeypatch):
    arms = {"human": {"training": [9.0], "held_out": {"fitness": [7.0, 9.5], "reward": [0.0, 0.0]}},
            "sparse": {"training": [5.0], "held_out": {"fitness": [None, 3.0], "reward": [0.0, 0.0]}}}  # fmt: skip
    ant = {**arms, "env_steps": 10, "worlds": 1, "device": "a GPU", "date": "2026-01-01"}
    monkeypatch.setattr(baselines, "_shipped", lambda: {"ant": ant})
    envs()
    rows = {line.split()[0]: line.split() for line in capsys.readouterr().out.split("\n\n")[0].splitlines()}
    assert rows["ant"][5:7] == ["8.25", "3"]
    assert rows["cartpole"][5:7] == ["-", "-"]


def test_context_shows_the_state_and_hides_the_fitness(capsys):
    context(["env=cartpole"])
    text = capsys.readouterr().out
    assert "pole_angle     Tensor (N)     pole angle from upright [rad]" in text
    assert "def compute_state" in text and "fitness" not in text
    assert "The task score: steps the pole stays up, from 0 to 499; higher is better." in text
    assert "MAX_FORCE" not in text and "An episode has at most 499 steps" in text and "`pole_angle` -0." in text
