"""Every task's human reward is a program that passes the checks of generated ones, and it is this that trains."""

from pathlib import Path

import pytest
import torch
from torch import Tensor

from openeureka.errors import TaskError
from openeureka.reward import gate, graph, probe
from openeureka.reward.examine import examine
from openeureka.reward.load import load
from openeureka.suite.isaac.cartpole import Cartpole
from openeureka.tasks import human
from openeureka.tasks.record import record_states
from openeureka.tasks.registry import get, make, names
from openeureka.tasks.task import State

QUOTES = '"""\n'
EXAMPLE = Path(__file__).parents[2] / "examples" / "pendulum.py"
PENDULUM = EXAMPLE.read_text()


@pytest.mark.parametrize("env", names())
def test_a_human_reward_passes_what_a_generated_one_must_pass_and_is_what_trains(env: str) -> None:
    task = get(env)
    checked = gate.check(human.program(task), task.spec)
    assert isinstance(checked, gate.Program), checked
    recorded = record_states(env, worlds=8, steps=8, keep=3)
    traced = probe.probe(load(checked), task.spec, recorded)
    assert examine(traced, task.spec, recorded, worlds=8) == ()
    assert len(traced.graph.components) > 1
    reward, _ = graph.CompiledReward(traced.graph, task.spec)(recorded)
    assert torch.equal(human.compiled(task, recorded)(recorded)[0], reward)


def test_the_file_of_a_human_reward_says_the_numbers_of_a_task_that_it_is_for() -> None:
    tasks = [get(env) for env in names()]
    told = {task.human for task in tasks if human.program(task) == Path(task.human).read_text()}
    assert told == {task.human for task in tasks}


@pytest.mark.parametrize(
    ("env", "line"),
    [
        ("shadow_hand_door_close_inward", "OFFSET = 2.0"),
        ("shadow_hand_door_close_outward", "OFFSET = 6.0"),
        ("shadow_hand_spin", "DISTANCE_WEIGHT = 0.1"),
        ("shadow_hand_upside_down", "DISTANCE_WEIGHT = -10.0"),
    ],
)
def test_tasks_that_share_a_human_reward_have_numbers_of_their_own(env: str, line: str) -> None:
    assert line in human.program(get(env)).splitlines()


def test_a_variant_of_a_task_has_the_human_reward_that_goes_with_it() -> None:
    assert "FALL_HEIGHT = 0.5  # [m]\n" in human.program(get("ant+fall_height=0.5"))
    spin = "shadow_hand_spin"
    state = make(spin, worlds=1, threads=1).current_state() | {"rotation_distance": torch.tensor([0.15, 0.18])}
    state |= {name: state[name].expand(2, -1) for name in ("object_pos", "goal_pos", "actions")}
    waypoints, tumble = (make(env, worlds=2, threads=1).task for env in (spin, f"{spin}+random_goals=true"))
    assert (waypoints.human_reward(state) > 200).tolist() == [True, False]  # reached within 0.156 rad
    assert (tumble.human_reward(state) > 200).tolist() == [True, True]  # reached within 0.2 rad


def with_human(path: Path, text: str) -> str:
    """A pendulum with another human reward."""
    before, _, rest = PENDULUM.partition('    human = """')
    path.write_text(f"{before}{text}\n{rest.partition(QUOTES)[2]}")
    return str(path)


def test_a_person_gives_text_or_a_file(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("def compute_reward(angle):\n    return angle * 2.0, {}\n")
    env = with_human(tmp_path / "a.py", '    human = __import__("pathlib").Path(__file__).parent / "mine.py"')
    state = {"angle": torch.tensor([1.0, 3.0])}
    assert make(env, worlds=1).task.human_reward(state).tolist() == [2.0, 6.0]
    assert human.program(get(str(EXAMPLE))).startswith("import torch\n\ndef compute_reward(angle, ")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('    human = "def compute_reward(angl):\\n    return angl, {}"', "line 1: `angl` is not a state variable"),
        ('    human = "def compute_reward(angle):\\n    return angle.sum(), {}"', "the reward has shape"),
        ('    human = "def compute_reward(num_envs):\\n    return torch.ones(num_envs), {}"', "[constant-reward]"),
        ('    human = __import__("pathlib").Path("gone.py")', "cannot be read from gone.py"),
    ],
)
def test_a_program_that_breaks_a_rule_is_refused_in_one_sentence(tmp_path: Path, text: str, says: str) -> None:
    task = make(with_human(tmp_path / "a.py", text), worlds=1).task
    with pytest.raises(TaskError) as caught:
        task.human_reward({"angle": torch.zeros(3)})
    assert says in str(caught.value) and "human reward of `pendulum`" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_method_trains_and_no_search_begins_with_it(tmp_path: Path) -> None:
    text = "    def human_reward(self, s):\n        return s['angle'] - self.progress\n"
    env = with_human(tmp_path / "a.py", text)
    assert make(env, worlds=1).task.human_reward({"angle": torch.zeros(1)}).tolist() == [0.0]
    with pytest.raises(
        TaskError, match=r"is a method, not a program; set `human = \.\.\.` in the task, or .* init=FILE"
    ):
        human.program(get(env))


def test_a_method_goes_before_the_program_of_the_task_that_it_builds_on() -> None:
    class Constant(Cartpole):
        def human_reward(self, s: State) -> Tensor:
            return torch.ones_like(s["pole_angle"])

    with pytest.raises(TaskError, match="is a method, not a program"):
        human.program(Constant)


def test_a_constant_that_is_computed_has_the_attribute_s_value_whole(tmp_path: Path) -> None:
    text = '    most = 12 * math.pi / 180\n    human = """\nMOST = 12 * math.pi / 180  # [rad]\n'
    text += 'def compute_reward(angle):\n    return (angle < MOST).float(), {}\n"""'
    env = with_human(tmp_path / "a.py", text)
    assert "MOST = 0.20943951023931953  # [rad]\n" in human.program(get(env))
    assert "MOST = 0.5  # [rad]\n" in human.program(get(f"{env}+most=0.5"))


def test_a_task_without_a_human_reward_is_not_complete(tmp_path: Path) -> None:
    with pytest.raises(TaskError, match="is not complete: define human"):
        get(with_human(tmp_path / "a.py", ""))
