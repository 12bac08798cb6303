"""A person's task that is broken: every command says file, line and error in one sentence, and ends with status 2."""

from pathlib import Path

import pytest
import rendering

from openeureka.cli.main import main
from openeureka.errors import TaskError
from openeureka.film import video
from openeureka.film.video import VideoUnavailable
from openeureka.tasks.context import context
from openeureka.tasks.record import record_states, try_out
from openeureka.tasks.registry import get, make

PENDULUM = (Path(__file__).parents[2] / "examples" / "pendulum.py").read_text()
REWARD = "import torch\n\n\ndef compute_reward(angle):\n    return torch.cos(angle), {}\n"
TYPO = ("self.ctrl[:] = actions", "self.ctrl[:] = acions")
NO_VARIABLE = ('            "actions": self.actions,\n', "")
SIZE = ("num_observations = 3", "num_observations = 4")
NO_XML = ("spec = mujoco.MjSpec()", "spec = mujoco.MjSpec.from_file('no_such.xml')")
EXIT = (TYPO[0], "raise SystemExit(0)")
IN_A_REWARD = ('return (s["angle"].abs()', 'return (s["angl"].abs()')
IN_THE_HUMAN = ("upright = torch.cos(angle)", "upright = torch.cos(angl)")


@pytest.fixture
def broken(tmp_path, monkeypatch):
    """A function that writes the pendulum with a text replaced. Returns its path and the line of the replaced text."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "reward.py").write_text(REWARD)

    def breaking(old: str, new: str) -> tuple[str, int]:
        assert PENDULUM.count(old) >= 1
        file = tmp_path / "broken.py"
        file.write_text(PENDULUM.replace(old, new, 1))
        return str(file), PENDULUM[: PENDULUM.index(old)].count("\n") + 1

    return breaking


CONTEXT = ("context",)


@pytest.mark.parametrize(
    ("words", "change", "says"),
    [
        (CONTEXT, NO_XML, "line {line}, in `model`: ValueError: ParseXML: Error opening file 'no_such.xml'."),
        (CONTEXT, IN_A_REWARD, "line {line}, in `sparse_reward`: KeyError: 'angl'."),
        (CONTEXT, EXIT, "line {line}, in `apply_action`: sys.exit(0) was called; raise an error instead."),
        *(
            (words, TYPO, "line {line}, in `apply_action`: NameError: name 'acions' is not defined.")
            for words in (
                CONTEXT,
                ("check", "reward.py"),
                ("train", "steps=4096", "threads=1", "dir=out"),
                ("run", "model=random", "sample=1", "iteration=1", "steps=4096", "dir=out"),
            )
        ),
    ],
)
def test_an_error_of_the_task_s_own_code_is_one_sentence_with_its_line(broken, words, change, says, capsys):
    file, line = broken(*change)
    with pytest.raises(SystemExit) as ended:
        main([words[0], f"env={file}", *words[1:]])
    streams = capsys.readouterr()
    (sentence,) = streams.err.splitlines()
    assert (ended.value.code, sentence) == (2, f"{file}, {says.format(line=line)}")
    assert "in out" not in streams.out and not Path("out").exists()


@pytest.mark.usefixtures("lasting")
def test_a_training_that_a_broken_task_ends_says_so_and_fails(broken, capsys):
    file, _ = broken(TYPO[0], "self.ctrl[:] = actions if self.num_envs == 1 else actions[:, 5]")
    with pytest.raises(SystemExit) as ended:
        main(["train", f"env={file}", "steps=4096", "threads=1", "dir=out"])
    streams = capsys.readouterr()
    sentence, again = streams.err.splitlines()
    assert again.startswith("What is done is kept. Continue with: eureka resume ")
    assert ended.value.code == 2 and sentence.startswith(f"{file}, line ")
    assert "in `apply_action`: IndexError" in sentence
    assert "report.html" not in streams.out


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (NO_VARIABLE, "line 73: `compute_state` returns no `actions`, which `spec` lists."),
        (
            SIZE,
            "line 81: `observe` returns observations of shape (1, 3); (1, 4) is needed, as num_observations=4 says.",
        ),
        (
            ('self.qvel[:, 0].clone(),\n            "actions"', 'self.qvel.clone(),\n            "actions"'),
            "line 73: `compute_state` returns `angular_velocity` of shape (1, 1); (1,) is needed, as `spec` says.",
        ),
        (
            ('torch.zeros_like(s["angle"], dtype=torch.bool)', "False"),
            "line 84: `terminated` returns a value as bool; a tensor of shape (1,) is needed.",
        ),
        (
            ("return mean_over_steps(self.sparse_reward(s))", "return self.sparse_reward(s)"),
            "line 91: `fitness` returns Tensor; it must return a Score, as mean_over_steps and mean_over_episodes do.",
        ),
        (
            ("(s[\"angle\"].abs() < UPRIGHT).to(torch.float32)", "torch.zeros(self.num_envs, 1)"),
            "line 91: `fitness` returns a value of shape (1, 1); (1,) is needed, one per world.",
        ),
    ],
)  # fmt: skip
def test_what_a_method_must_give_is_said_with_the_line_of_the_method(broken, change, says):
    file, _ = broken(*change)
    with pytest.raises(TaskError) as caught:
        try_out(file)
    assert str(caught.value) == f"{file}, {says}"


@pytest.mark.parametrize("trial", [try_out, record_states])
@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            ("self.qvel[:, 0].clone()", "self.qvel[:, 0] / (self.progress - 1)"),  # divided by 0 after the first step
            "`angular_velocity` of the task `pendulum` is not finite in some states of random play",
        ),
        (
            ("torch.cos(s[\"angle\"]),", "torch.log(s[\"angle\"] - 100.0),"),
            "`obs_buf` of the task `pendulum` is not finite in some states of random play",
        ),
        (
            ("self.ctrl[:] = actions", "self.ctrl = actions"),
            "The task `pendulum` replaces `self.ctrl`, which belongs to the simulator, so the simulator never sees the "
            "new values: write self.ctrl[:] = ...",
        ),
        (
            ("self.qpos[worlds] =", "self.qpos ="),
            "The task `pendulum` replaces `self.qpos`, which belongs to the simulator",
        ),
    ],
)  # fmt: skip
def test_what_no_policy_could_learn_from_is_told_before_a_model_is_paid(broken, change, says, trial):
    file, _ = broken(*change)
    with pytest.raises(TaskError) as caught:
        trial(file)
    assert str(caught.value).startswith(says)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("control_dt = 0.05", "control_dt = 0"), "`control_dt` {} must be a number of seconds above zero; it is 0."),
        (("substeps = 4", "substeps = 0"), "`substeps` {} must be a whole number above zero; it is 0."),
        (("substeps = 4", "substeps = 4.0"), "`substeps` {} must be a whole number above zero; it is 4.0."),
        (("episode_length = 200", "episode_length = 0"), "`episode_length` {} must be a whole number above zero;"),
        (("    recipe", "    memory = 'goal'\n    recipe"), "`memory` {} must be a tuple of names; it is 'goal'."),
        (("    recipe", "    score_range = 1.0\n    recipe"), "`score_range` {} must be the least and the largest F, "),
        (("spec = StateSpec(", "spec = tuple("), "`spec` {} must be a StateSpec; it is (StateVar("),
        (("human = ", "human = len or "), "`human` {} must be the text of a reward program, or the Path of its file."),
        (
            ("    @staticmethod\n    def model()", "    def model(self)"),
            "`model` {} must be a function without arguments: write @staticmethod above it.",
        ),
        (("__init__(self, *args)", "__init__(self)"), "`__init__` {} must take two arguments: write def __init__("),
    ],
)  # fmt: skip
def test_an_attribute_that_no_task_can_have_is_one_sentence(broken, change, says):
    file, _ = broken(*change)
    with pytest.raises(TaskError) as caught:
        get(file)
    assert str(caught.value).startswith(says.format("of the task `pendulum`"))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("hidden=(32, 32)", "hidden=32"), "line 43: ValueError: hidden=32 in the recipe must be the sizes of the "),
        (("hidden=(32, 32)", "hidden=(32,), worlds=0"), "line 43: ValueError: worlds=0 in the recipe must be a whole"),
        (('use="zero_centred"', 'use="zero"'), "line 38: ValueError: the use of `angle` is 'zero'; it is one of raw, "),
        (('m", (1,)', 'm", 1'), "line 40: ValueError: the shape of `actions` is 1; write a tuple, such as (3,)."),
    ],
)  # fmt: skip
def test_a_recipe_or_a_variable_that_cannot_be_is_told_with_its_line(broken, change, says):
    file, _ = broken(*change)
    with pytest.raises(TaskError) as caught:
        get(file)
    assert says in str(caught.value)


def test_a_compiled_model_is_refused_where_a_spec_is_wanted(broken):
    file, _ = broken("return spec", "return spec.compile()")
    with pytest.raises(
        TaskError, match=r"broken\.py: `model` of `Pendulum` returns MjModel; it must return a mujoco.MjSpec"
    ):
        make(file, worlds=1)


def test_the_table_says_the_size_of_the_observation(broken):
    file, _ = broken('the angle, rate", (3,)', 'the angle, rate", (4,)')
    with pytest.raises(TaskError, match=r"lists `obs_buf` with the shape \(4,\), but num_observations=3 means \(3,\)"):
        try_out(file)


def test_a_model_is_asked_for_nothing_without_a_description(broken):
    file, _ = broken('"to swing the pendulum up and keep it upright"', '" "')
    with pytest.raises(TaskError, match="`description` of the task `pendulum` is empty"):
        context(file)
    try_out(file)  # only a model's prompt needs the description


def test_physics_that_breaks_down_in_most_steps_is_told_before_a_model_is_paid(broken):
    file, _ = broken("self.ctrl[:] = actions", "self.ctrl[:] = 1e9 * actions")
    with pytest.raises(TaskError, match=r"breaks down in \d+ of 80 steps of random play"):
        record_states(file, worlds=8, steps=10, keep=2)


def test_a_world_that_breaks_down_now_and_then_does_no_harm(broken):
    file, _ = broken("self.ctrl[:] = actions", "self.ctrl[:] = torch.where(actions > 0.9, 1e9, actions)")
    record_states(file, worlds=8, steps=10, keep=2)


def test_a_human_reward_that_breaks_a_rule_is_told_before_anything_is_made(broken, capsys):
    file, _ = broken(*IN_THE_HUMAN)
    with pytest.raises(SystemExit) as ended:
        main(["run", f"env={file}", "model=random", "sample=1", "iteration=1", "steps=4096", "dir=out"])
    (sentence,) = capsys.readouterr().err.splitlines()
    assert ended.value.code == 2 and not Path("out").exists()
    assert sentence.startswith("The human reward of `pendulum` is refused: line 4: `angl` is not defined")


def test_a_mesh_that_is_not_there_is_named(broken):
    old = "rod.add_geom("
    file, _ = broken(old, f"spec.add_mesh(name='hull', file='absent.stl')\n        {old}")
    with pytest.raises(TaskError, match=r"broken\.py: the model of `Pendulum` does not compile: .*absent\.stl"):
        make(file, worlds=1)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            ("num_actions = 1", "num_actions = ONE"),
            "cannot be imported: line 33: NameError: name 'ONE' is not defined.",
        ),
        (
            ("num_actions = 1", "num_actions = exit(2)"),
            "cannot be imported: line 33: sys.exit(2) was called; raise an error instead.",
        ),
        (("num_actions = 1", "num_actions = = 1"), "(broken.py, line 33) `num_actions = = 1`."),
    ],
)
def test_an_error_on_import_has_its_line(broken, change, says):
    file, _ = broken(*change)
    with pytest.raises(TaskError) as caught:
        get(file)
    assert str(caught.value).endswith(says)


def test_a_method_that_is_a_lambda_is_asked_to_be_written_with_def(broken, capsys):
    old = "    def reset("
    file, line = broken(old, f"    terminated = lambda self, s: s['angle'] > 9\n\n{old}")
    with pytest.raises(SystemExit) as ended:
        main(["context", f"env={file}"])
    (sentence,) = capsys.readouterr().err.splitlines()
    assert (ended.value.code, sentence) == (2, f"{file}, line {line}: use `def` in place of `lambda`.")


@pytest.mark.parametrize("change", [TYPO, NO_XML])
def test_opengl_is_not_blamed_for_a_broken_task(broken, change):
    rendering.needed()
    file, _ = broken(*change)
    with pytest.raises(VideoUnavailable, match=r"broken\.py, line \d+") as caught:
        video.render(file, "random", seconds=0.1)
    assert "OpenGL" not in str(caught.value)
