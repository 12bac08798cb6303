"""Exported rewards pay in Gymnasium what they paid in training, and `eureka new` drafts task files of environments."""

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import torch

pytest.importorskip("gymnasium", reason="needs Gymnasium: pip install 'openeureka[gym]'")

import gymnasium

from openeureka.cli.main import main
from openeureka.errors import TaskError
from openeureka.reward import gate, probe
from openeureka.reward import graph as graphs
from openeureka.reward.load import load
from openeureka.tasks import registry
from openeureka.tasks.record import record_states
from openeureka.tasks.task import State, Task
from openeureka.types import RewardGraph

from . import worlds  # noqa: F401  registers its environments

STEPS = 30
PROGRAMS = {
    "gym-asis:Hopper-v5": """
        def compute_reward(x_velocity: torch.Tensor, obs_buf: torch.Tensor, previous_obs_buf, actions):
            moved = torch.norm(obs_buf - previous_obs_buf, dim=-1)
            upright = torch.exp(-torch.square(obs_buf[:, 1]) / 0.1)
            effort = torch.max(torch.sum(actions ** 2, dim=-1), torch.tensor(0.1))
            return x_velocity + 0.5 * upright - 0.1 * effort + moved, {"upright": upright, "effort": effort}
    """,
    "gym:CartPole-v1": """
        def compute_reward(pole_angle, cart_position, actions):
            near = torch.where(cart_position.abs() < 0.02, 1.0, -0.5)
            return near - pole_angle.abs() + 0.25 * actions[:, 1], {"near": near}
    """,
    "gym:Openeureka/Clock-v0": """
        def compute_reward(phase, step, actions, luck):
            shown = (phase * torch.arange(3, device=phase.device)).sum(dim=-1)
            return shown + step[:, 0] * actions[:, 4] + 0.001 * luck, {"shown": shown}
    """,
    **dict.fromkeys(
        ("gym:Openeureka/Whole-v0", "gym:Openeureka/Fixed-v0"),
        """
        def compute_reward(actions):
            return actions[:, 0] + 10.0 * actions[:, 1], {"second": actions[:, 1]}
    """,
    ),
}


def graph_of(task: type[Task], program: str, states: State) -> RewardGraph:
    """Traces a program in this process: programs of the tests need no sandbox."""
    checked = gate.check(f"import torch\n{program.strip()}", task.spec)
    assert isinstance(checked, gate.Program), checked
    return probe.probe(load(checked), task.spec, states).graph


def loaded(text: str) -> ModuleType:
    module = ModuleType("handed_back")
    exec(text, module.__dict__)
    return module


@pytest.mark.parametrize("env", PROGRAMS)
def test_a_wrapper_pays_what_the_graph_paid(env: str):
    program = "\n".join(line[8:] for line in PROGRAMS[env].splitlines())
    simulation = registry.make(env, worlds=1)
    graph = graph_of(type(simulation.task), program, record_states(env, worlds=4, steps=3, keep=2))
    reward = graphs.CompiledReward(graph, simulation.task.spec)
    text = type(simulation.task).handed_back(graph, program)
    assert "openeureka" not in {line.split()[1] for line in text.splitlines() if line.startswith(("import", "from"))}
    theirs = loaded(text).EurekaReward(gymnasium.make(env.partition(":")[2]))

    simulation.reset()
    seed = int(simulation.sim.seeds[0])
    theirs.reset(seed=seed)
    generator = torch.Generator().manual_seed(0)
    for _ in range(STEPS):
        step = simulation.step(torch.randn(1, simulation.task.num_actions, generator=generator))
        if bool(step.done[0]):
            break
        ours, components = reward(step.state)
        (taken,) = simulation.task.survey.actions.taken(simulation.sim.action)
        _, paid, _, _, info = theirs.step(taken)
        assert paid == pytest.approx(float(ours[0]), abs=2e-6)
        assert info["parts"] == pytest.approx({name: float(part[0]) for name, part in components.items()}, abs=2e-6)
        assert info["reward_of_environment"] == pytest.approx(float(simulation.task.paid[0]), abs=1e-5)


def test_a_wrapper_makes_the_environment_as_it_was_trained_on():
    task = registry.get("gym:Hopper-v5+exclude_current_positions_from_observation=false+healthy_reward=0.5")
    graph = graph_of(task, PROGRAMS["gym-asis:Hopper-v5"].strip(), record_states(task.env, worlds=4, steps=3, keep=2))
    text = task.handed_back(graph, "")
    (made,) = (line.strip() for line in text.splitlines() if "gymnasium.make" in line)
    theirs = eval(made.removeprefix("env = "), {"gymnasium": gymnasium, **vars(loaded(text))})
    assert theirs.observation_space.shape == (task.num_observations,) == (12,)
    assert theirs.unwrapped._healthy_reward == 0.5
    fixed = gymnasium.spaces.Box(np.float32([-1.0, 0.5]), np.float32([1.0, 0.5]))
    assert loaded(text).normal(fixed, [0.5, 0.5]).tolist() == [0.5, 0.0]
    several = gymnasium.spaces.MultiBinary([2, 2])
    assert loaded(text).normal(several, [[0, 1], [1, 0]]).tolist() == [1, 0, 0, 1, 0, 1, 1, 0]
    endless = gymnasium.spaces.Box(-3e38, 3e38, (1,))  # bounds this large count as none, as in training
    assert loaded(text).normal(endless, [0.5]).tolist() == [0.5]


def test_a_wrapper_takes_zeros_for_what_info_leaves_out():
    program = "def compute_reward(pressed, late):\n    return pressed[:, 1] + late[:, 0], {'pressed': pressed[:, 1]}"
    env = "gym:Openeureka/Presser-v0"
    graph = graph_of(registry.get(env), program, record_states(env, worlds=4, steps=3, keep=2))
    text = registry.get(env).handed_back(graph, program)
    theirs = loaded(text).EurekaReward(gymnasium.make("Openeureka/Presser-v0"))
    theirs.reset(seed=0)
    paid = [theirs.step(np.array([0, 0]))[1] for _ in range(14)]
    assert paid == [3.0, 1.0] * 5 + [3.0, 0.0, 2.0, 0.0]  # `late` has two numbers from step 12 on


def with_square(text: str) -> str:
    """A drafted file's text, with the variable added that the draft proposes in a comment."""
    table = "spec = StateSpec(\n        ("
    assert table in text and '# state["squared"]' in text
    added = f'{table}StateVar("squared", "of the first"),'
    return text.replace('# state["squared"]', 'state["squared"]').replace(table, added)


def test_a_variable_that_a_task_file_computes_does_not_go_back(tmp_path: Path):
    drafted(tmp_path / "first.py", "gym:CartPole-v1")
    file = tmp_path / "mine.py"
    file.write_text(with_square((tmp_path / "first.py").read_text()))
    program = "def compute_reward(squared):\n    return squared, {'squared': squared}"
    graph = graph_of(registry.get(str(file)), program, record_states(str(file), worlds=4, steps=3, keep=2))
    with pytest.raises(TaskError, match="reads `squared`, which .* does not provide outside openeureka"):
        registry.get(str(file)).handed_back(graph, "")


# --- the file of an environment ---------------------------------------------------------------------------------------


def drafted(file: Path, env: str) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["new", str(file), f"env={env}"])
    assert ended.value.code == 0


def test_a_drafted_file_is_the_same_task_and_its_variables_can_be_renamed_hidden_and_added(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    file = tmp_path / "balance.py"
    drafted(file, "gym:CartPole-v1")
    assert f"eureka train env={file}" in capsys.readouterr().out
    assert "# F is the sum of the environment's own reward" in file.read_text()
    same, base = registry.make(str(file), worlds=3), registry.make("gym:CartPole-v1", worlds=3)
    same.reset()
    base.reset()
    right = torch.tensor([[0.0, 1.0]] * 3)
    mine, theirs = (simulation.step(right).state for simulation in (same, base))
    assert mine.keys() == theirs.keys() and all(torch.equal(mine[name], theirs[name]) for name in mine)

    edited = tmp_path / "edited.py"
    lines = [line for line in file.read_text().splitlines() if "cart_velocity" not in line]
    edited.write_text(with_square("\n".join(lines).replace('pole_angle"', 'lean"')))
    changed = registry.make(str(edited), worlds=3)
    changed.reset()
    state = changed.step(right).state
    assert torch.equal(state["lean"], theirs["pole_angle"]) and "cart_velocity" not in state
    assert torch.equal(state["squared"], theirs["cart_position"].square())
    np.testing.assert_array_equal(state["obs_buf"], theirs["obs_buf"])


@pytest.mark.parametrize(
    "old, new, said",
    [
        (
            'StateVar("pole_angle"',
            'StateVar("lean"',
            "`places` lists `pole_angle`, but `spec` does not; rename it in both",
        ),
        (
            "slice(2, 3)",
            '"lean"',
            "`pole_angle` is `lean` of `info`, which the environment did not report in random play. It reported no",
        ),
    ],
)
def test_a_name_that_a_task_file_has_in_one_place_alone_is_told(tmp_path: Path, old: str, new: str, said: str):
    drafted(tmp_path / "first.py", "gym:CartPole-v1")
    text = (tmp_path / "first.py").read_text()
    assert text.count(old) == 1
    edited = tmp_path / "edited.py"
    edited.write_text(text.replace(old, new))
    with pytest.raises(TaskError) as caught:
        registry.make(str(edited), worlds=1).reset()
    assert said in str(caught.value)


def test_f_counts_the_same_whatever_a_drafted_file_calls_or_hides(tmp_path: Path):
    env = "gym:Pendulum-v1+fitness=-abs(angular_velocity)"
    file = tmp_path / "swing.py"
    drafted(file, env)
    lines = file.read_text().splitlines()
    edited = {
        "renamed": "\n".join(lines).replace('angular_velocity"', 'spin"'),
        "hidden": "\n".join(line for line in lines if "angular_velocity" not in line or "fitness=" in line),
    }
    for name, text in edited.items():
        assert "# F is what `fitness=` says" in text
        changed = tmp_path / f"{name}.py"
        changed.write_text(text)
        base, mine = registry.make(env, worlds=3), registry.make(str(changed), worlds=3)
        assert "angular_velocity" not in mine.task.spec
        for simulation in (base, mine):
            simulation.reset()
        push = torch.full((3, 1), 0.5)
        theirs, ours = base.step(push).state, mine.step(push).state
        assert torch.equal(ours["outcome"], theirs["outcome"])
        assert torch.equal(theirs["outcome"], -theirs["angular_velocity"].abs())


def test_a_task_that_is_a_file_is_not_drafted_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as ended:
        main(["new", str(tmp_path / "x.py"), "env=cartpole"])
    assert ended.value.code == 2 and "`cartpole` already has a task file" in capsys.readouterr().err
    assert not (tmp_path / "x.py").exists()
