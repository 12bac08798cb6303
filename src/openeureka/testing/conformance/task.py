"""What every task must do. Inherit, name the environment, and let pytest collect it:

class TestMyTask(TaskConformance):
    env = "my_package.my_task:MyTask"
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from typing import Any
from unittest import SkipTest

import torch
from torch import Tensor

from openeureka.sim.base import aligned
from openeureka.tasks.context import context
from openeureka.tasks.env import BatchedEnv, Step
from openeureka.tasks.human import program
from openeureka.tasks.record import record_states
from openeureka.tasks.registry import get, make
from openeureka.tasks.task import Score, State, Task
from openeureka.training.replay import waits

_HIDDEN = ("outcome", "fitness", "human_reward", "sparse_reward", "terminated", "reset")


class TaskConformance:
    """Checks that hold for any task; what a task computes is for its own tests to say.

    Attributes:
        env: name or import string of the task.
        random_start: whether episodes start in different states.
        start_overlap: deepest penetration of any contact in a start pose [m].
        random_worlds: worlds that are under random control for two seconds.
    """

    env: str
    random_start = True
    start_overlap = 1e-3
    random_worlds = 256

    def test_state_variables_are_those_of_the_spec(self) -> None:
        simulation = self._make(worlds=5)
        simulation.reset()
        for state in (simulation.current_state(), _random_steps(simulation, 3)[-1].state):
            self._check_state(state, worlds=5)

    def test_recorded_values_do_not_change_when_the_simulation_goes_on(self) -> None:
        simulation = self._make(worlds=8)
        simulation.reset()
        simulation.task.progress[::2] = simulation.task.time_limit() - 1  # half of the worlds are reset at once
        recorded = _random_steps(simulation, 1)[0]
        kept = {name: tensor.clone() for name, tensor in _tensors(recorded).items()}
        _random_steps(simulation, 5)
        changed = _different(_tensors(recorded), kept)
        assert not changed, f"{changed} share memory with the simulator or the task: return a .clone() of each"

    def test_observations_are_clipped_and_obs_buf_is_not(self) -> None:
        simulation = self._make(worlds=6)
        task = simulation.task
        for observation in (simulation.reset(), *(step.final_observation for step in _random_steps(simulation, 20))):
            assert observation.shape == (6, task.num_observations)
            assert observation.dtype == torch.float32
            assert bool(observation.isfinite().all())
            assert float(observation.abs().max()) <= task.clip_observations
        state = simulation.current_state()
        assert torch.equal(state["obs_buf"], task.observe(state))

    def test_what_no_sensor_tells_is_part_of_the_observation(self) -> None:
        task = get(self.env)
        unseen = task.unseen("measurable")
        assert {name for name, _ in task.unmeasured} <= set(task.spec.names)
        assert len(set(unseen)) == len(unseen) < task.num_observations
        assert all(0 <= column < task.num_observations for column in unseen)

    def test_worlds_of_equal_seed_live_equal_lives_and_others_do_not(self) -> None:
        simulation = self._make(worlds=4, lane_seeds=(7, 7, 8))
        start = simulation.reset()
        assert torch.equal(start[0:4], start[4:8])
        if self.random_start:
            assert not torch.equal(start[0:4], start[8:12])
            assert not torch.equal(start[0], start[1])
        actions = torch.zeros(12, simulation.task.num_actions)
        steps = [simulation.step(actions) for _ in range(10)]
        assert all(torch.equal(step.observation[0:4], step.observation[4:8]) for step in steps)

    def test_another_environment_goes_on_from_a_saved_state(self) -> None:
        first, second = self._make(worlds=4), self._make(worlds=4)
        first.reset(stagger=True)
        second.reset()
        _random_steps(first, 5)
        first.task.progress[0] = first.task.time_limit() - 1  # a reset is among what follows
        second.load_state_dict(first.state_dict())
        for left, right in zip(*(_random_steps(simulation, 3) for simulation in (first, second)), strict=True):
            different = _different(_tensors(left), _tensors(right))
            assert not different, f"{different} differ: does the task keep a tensor that `memory` does not list?"

    def test_results_do_not_depend_on_the_number_of_threads(self) -> None:
        one, two = (self._make(worlds=6, threads=threads) for threads in (1, 2))
        assert torch.equal(one.reset(), two.reset())
        for a, b in zip(_random_steps(one, 30), _random_steps(two, 30), strict=True):
            assert torch.equal(a.observation, b.observation)

    def test_a_broken_world_is_reset_and_counted_and_leaves_the_others_alone(self) -> None:
        if get(self.env).choices:
            raise SkipTest("discrete actions cannot break a world, as they are never NaN")
        broken, sound = self._make(worlds=4), self._make(worlds=4)
        broken.reset()
        sound.reset()
        actions = torch.zeros(4, sound.task.num_actions)
        poison = actions.clone()
        poison[2] = torch.nan
        others = torch.tensor([0, 1, 3])

        step = broken.step(poison)
        assert step.bad.tolist() == [False, False, True, False]
        assert bool(step.terminated[2]) and broken.bad_total == 1
        assert float(step.score.weight[2]) == 0.0
        assert bool(step.observation.isfinite().all())
        self._check_equal(broken, sound, step, sound.step(actions), others)
        for _ in range(5):
            after, expected = broken.step(actions), sound.step(actions)
            assert not bool(after.bad.any())
            self._check_equal(broken, sound, after, expected, others)

        for simulation in (broken, sound):
            simulation.task.progress[others] = simulation.task.time_limit()
        self._check_equal(broken, sound, broken.step(actions), sound.step(actions), others)

    def test_a_world_is_judged_by_itself(self) -> None:
        simulation = self._make(worlds=6)
        simulation.reset()
        step = _random_steps(simulation, 5)[-1]
        own = {variable.name for variable in simulation.task.spec.variables if variable.kind == "world"} | {"outcome"}
        expected = _judged(simulation.task, step.state, step.ended)
        for strange in (torch.nan, 1000.0, -1000.0):
            worlds = torch.arange(6) == 2
            state = {
                name: value.masked_fill(aligned(worlds, value), strange) if name in own else value
                for name, value in step.state.items()
            }
            _check_alone(_judged(simulation.task, state, step.ended), expected, ~worlds)

    def test_a_reset_by_mask_is_a_reset_by_index(self) -> None:
        self._expect_mujoco()
        by_index, by_mask = self._make(worlds=6), self._make(worlds=6)
        by_mask.masked = True  # as on a GPU
        for simulation in (by_index, by_mask):
            simulation.reset()
            simulation.task.progress[1::2] = simulation.task.time_limit() - 3
        for a, b in zip(_random_steps(by_index, 8), _random_steps(by_mask, 8), strict=True):
            different = _different(_tensors(a), _tensors(b))
            assert not different, f"{different} differ: does the task keep a tensor that is not its attribute?"

    def test_a_step_asks_a_gpu_nothing(self) -> None:
        self._expect_mujoco()
        simulation = self._make(worlds=4)
        simulation.masked = True
        simulation.reset()
        simulation.task.progress[::2] = simulation.task.time_limit() - 1
        actions = torch.zeros(4, simulation.task.num_actions)

        def step() -> None:
            state = simulation.step(actions).state
            for reward in (simulation.task.human_reward, simulation.task.sparse_reward, simulation.task.success_bonus):
                reward(state)

        step()  # which also traces the human reward
        assert waits(step, uploads=True) == [], "each of these would stall a GPU"

    def test_an_episode_is_cut_off_at_its_time_limit(self) -> None:
        simulation = self._make(worlds=4)
        simulation.reset()
        limit = simulation.task.time_limit()
        simulation.task.progress[:] = torch.tensor([limit - 3, limit - 2, limit - 1, limit])
        step = simulation.step(torch.zeros(4, simulation.task.num_actions))
        assert step.timed_out.tolist() == [False, False, True, True]
        assert not bool(step.terminated.any())
        assert step.episode_length.tolist() == [limit - 2, limit - 1, limit, limit + 1]
        assert simulation.task.progress.tolist() == [limit - 2, limit - 1, 0, 0]

    def test_fitness_and_rewards_are_finite_numbers_per_world(self) -> None:
        simulation = self._make(worlds=16)
        simulation.reset()
        task = simulation.task
        for step in _random_steps(simulation, 30):
            for values in (*step.score, task.human_reward(step.state), task.sparse_reward(step.state)):
                assert values.shape == (16,) and values.dtype == torch.float32
                assert bool(values.isfinite().all())
            assert bool((step.score.weight >= 0.0).all())
            assert not bool((step.terminated & step.timed_out).any())

    def test_two_seconds_of_random_control_raise_no_warning(self) -> None:
        simulation = self._make(worlds=self.random_worlds, threads=0)
        simulation.reset()
        _random_steps(simulation, round(2.0 / simulation.task.control_dt))
        assert simulation.bad_total == 0

    def test_nothing_overlaps_in_a_start_pose(self) -> None:
        self._expect_mujoco()
        simulation = self._make(worlds=8)
        simulation.reset()
        for world in range(8):
            model, data = simulation.sim.snapshot(world)
            for contact in data.contact[: data.ncon]:
                names = [model.body(int(model.geom_bodyid[geom])).name for geom in contact.geom]
                assert contact.dist >= -self.start_overlap, f"{names} overlap by {-contact.dist:.4f} m"

    def test_quaternions_are_of_unit_length(self) -> None:
        simulation = self._make(worlds=8)
        simulation.reset()
        state = _random_steps(simulation, 10)[-1].state
        for variable in simulation.task.spec.variables:
            if variable.shape == (4,) and "quat" in variable.meaning:
                assert torch.allclose(state[variable.name].norm(dim=-1), torch.ones(8), atol=1e-4), variable.name

    def test_the_typed_grammar_has_something_to_work_with(self) -> None:
        variables = get(self.env).spec.variables
        assert len({variable.name for variable in variables if variable.use != "raw"}) >= 2
        for variable in variables:
            if variable.use == "point":
                assert variable.shape == (3,), f"{variable.name} is a point, so it must have three coordinates"

    def test_the_context_shows_the_motion_and_hides_the_goal(self) -> None:
        task, shown = get(self.env), context(self.env)
        assert shown.description and "\n" not in shown.description
        assert task.source or ("def observe" in shown.source and "def compute_state" in shown.source)
        for method in _HIDDEN:
            assert f"def {method}" not in shown.source
            self._check_hidden(shown.source, inspect.getsource(getattr(task, method)), method)
        if task.human:
            self._check_hidden(shown.source, program(task), "human")
        table = " ".join(variable.meaning for variable in shown.state.variables)
        for word in ("fitness", "reward", "success", "score", "recipe"):
            assert word not in shown.source and word not in table, f"the context mentions `{word}`"

    def test_states_can_be_recorded(self) -> None:
        self._check_state(record_states(self.env, worlds=4, steps=6, keep=3), worlds=12)

    def _check_equal(self, one: BatchedEnv, other: BatchedEnv, left: Step, right: Step, worlds: Tensor) -> None:
        """Check that these worlds go on as if nothing had happened to any other."""
        found, expected = (_judged(env.task, step.state, step.ended) for env, step in ((one, left), (other, right)))
        found["observation"], expected["observation"] = left.observation, right.observation
        _check_alone(found, expected, worlds)

    def _expect_mujoco(self) -> None:
        if get(self.env).steps_itself:
            raise SkipTest("an environment that steps itself runs on the CPU and has no MuJoCo model")

    def _check_hidden(self, shown: str, source: str, what: str) -> None:
        for line in _statements(source):
            assert line not in shown, f"`{line}` of {what} is shown to the language model"

    def _make(self, *, worlds: int, lane_seeds: tuple[int, ...] = (0,), threads: int = 1) -> BatchedEnv:
        return make(self.env, worlds=worlds, lane_seeds=lane_seeds, threads=threads)

    def _check_state(self, state: State, *, worlds: int) -> None:
        spec = get(self.env).spec
        assert set(state) - {"outcome"} == set(spec.names)
        for variable in spec.variables:
            value, name = state[variable.name], variable.name
            if variable.kind in ("world", "constant"):
                leading = (worlds,) if variable.kind == "world" else ()
                assert tuple(value.shape) == (*leading, *variable.shape), f"{name} has the shape {tuple(value.shape)}"
                allowed = (torch.float32,) if variable.kind == "world" else (torch.float32, torch.int64)
                assert value.dtype in allowed, f"{name} has the dtype {value.dtype}"
                assert bool(value.isfinite().all()), f"{name} is not finite"
            else:
                expected = float if variable.kind == "float" else int
                assert type(value) is expected, f"{name} is a {type(value).__name__}"


def _random_steps(simulation: BatchedEnv, count: int) -> list[Step]:
    generator = torch.Generator().manual_seed(0)
    shape = (simulation.num_worlds, simulation.task.num_actions)
    return [simulation.step(torch.randn(shape, generator=generator)) for _ in range(count)]


def _judged(task: Task, state: State, ended: Tensor) -> dict[str, Tensor]:
    """Termination, fitness and rewards of a state, (N, ...) each."""
    score = task.fitness(state, ended)
    return {
        "terminated": task.terminated(state),
        "fitness": torch.stack(score, dim=-1),
        "human_reward": task.human_reward(state),
        "sparse_reward": task.sparse_reward(state),
    }


def _check_alone(found: dict[str, Tensor], expected: dict[str, Tensor], worlds: Tensor) -> None:
    mixed = [name for name, values in found.items() if not torch.equal(values[worlds], expected[name][worlds])]
    assert not mixed, f"{mixed} of a world depend on other worlds: does a mean, maximum or sum lack dim=-1?"


def _tensors(step: Step) -> dict[str, Tensor]:
    parts: dict[str, Any] = {**step._asdict(), **step.state}
    parts |= {f"score.{name}": value for name, value in Score._asdict(step.score).items()}
    return {name: value for name, value in parts.items() if isinstance(value, Tensor)}


def _different(one: dict[str, Tensor], other: dict[str, Tensor]) -> list[str]:
    return [name for name, tensor in one.items() if not torch.equal(tensor, other[name])]


def _statements(source: str) -> list[str]:
    """First lines of the statements of its functions, long enough not to occur elsewhere by chance."""
    source = textwrap.dedent(source)
    functions = [node for node in ast.parse(source).body if isinstance(node, ast.FunctionDef)]
    texts = [ast.get_source_segment(source, part) or "" for function in functions for part in function.body]
    return [line for text in texts if len(line := text.partition("\n")[0]) > 15]
