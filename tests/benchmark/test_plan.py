"""What a plan may contain, and the error for anything else."""

import re
from pathlib import Path

import numpy as np
import pytest

from openeureka.benchmark.plan import Cell, Plan, load, plan
from openeureka.errors import ConfigError
from openeureka.strategies import SEARCHES

GOOD = """
tasks: [cartpole, ant]
seeds: [0, 10]
settings: {model: random, sample: 8, iteration: 3, steps: 1e5}
per_task: {ant: {steps: 2000000, worlds: 64}}
arms:
  full:
  no_evolution: {iteration: 1, sample: 24}
  short: {steps: 1000.0}
"""


def written(tmp_path, text):
    path = tmp_path / "plan.yaml"
    path.write_text(text)
    return path


def test_cells_have_the_settings_of_all_then_of_the_task_then_of_the_arm(tmp_path):
    read = load(written(tmp_path, GOOD))
    full, short = (read.config(Cell("ant", arm, 10)) for arm in ("full", "short"))
    assert (full.env, full.seed, full.model, full.sample, full.steps) == ("ant", 10, "random", 8, 2_000_000)
    assert (short.steps, short.worlds) == (1000, 64)
    assert read.config(Cell("cartpole", "full", 0)).steps == 100_000
    assert read.config(Cell("cartpole", "no_evolution", 0)).iteration == 1


def test_all_arms_of_a_seed_come_before_the_next_seed(tmp_path):
    names = [cell.name for cell in load(written(tmp_path, GOOD)).cells()]
    assert names[:4] == ["cartpole-full-0", "cartpole-no_evolution-0", "cartpole-short-0", "ant-full-0"]
    assert [name.rpartition("-")[2] for name in names] == ["0"] * 6 + ["10"] * 6


def test_files_are_found_from_where_the_plan_is(tmp_path):
    arms = "{own: {init: mine.py, model: 'replay:../a.json'}, people: {init: human}}"
    text = f"{{tasks: [my/task.py], seeds: [0], arms: {arms}}}"
    read = load(written(tmp_path, text))
    assert read.tasks == (f"{tmp_path}/my/task.py",)
    own, people = (read.config(cell) for cell in read.cells())
    assert (own.init, people.init) == (f"{tmp_path}/mine.py", "human")
    assert (own.model, people.model) == (f"replay:{tmp_path.parent}/a.json", "local")
    assert next(read.cells()).name == "task-own-0"


REST = "{tasks: [cartpole], seeds: [0], arms: {a: {}}, "


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[1, 2]", "A plan must be a mapping with `tasks`, `seeds` and `arms`."),
        ("{tasks: [cartpole], seeds: [0]}", "The plan has no arms."),
        ("{tasks: [], seeds: [0], arms: {a: {}}}", "The plan has no tasks."),
        (REST + "setings: {}}", "A plan has no `setings`. Did you mean `settings`?"),
        ("{tasks: cartpole, seeds: [0], arms: {a: {}}}", "`tasks` must be a list of names, not `cartpole`."),
        ("{tasks: [cartpole], seeds: [zero], arms: {a: {}}}", "`seeds` must be a list of whole numbers"),
        ("{tasks: [cartpole], seeds: [true], arms: {a: {}}}", "`seeds` must be a list of whole numbers"),
        ("{tasks: [cartpole], seeds: [-1], arms: {a: {}}}", "`seeds` must be zero or more."),
        ("{tasks: [cartpole], seeds: [1, 1], arms: {a: {}}}", "names the seed 1 twice."),
        (
            "{tasks: [cartpole], seeds: [0, 3], arms: {a: {}}}",
            "The seeds 0 and 3 are too close: a search with seed 0 uses seeds up to 3",
        ),
        ("{tasks: [a.py, b/a.py], seeds: [1], arms: {a: {}}}", "names the task a twice."),
        ("{tasks: [cartpole], seeds: [0], arms: [a]}", "`arms` must be a mapping of names to settings"),
        (
            "{tasks: [cartpole], seeds: [0], arms: {off: {}}}",
            "`arms` has the name `False`, which is not text",
        ),
        ("{tasks: [cartpole], seeds: [010, 020], arms: {a: {}}}", "`010` means 8 in YAML: leave out the leading zero"),
        ("{tasks: [cartpole], seeds: [0], arms: {a: 3}}", "`arms.a` must be a mapping of settings"),
        ("{tasks: [cartpole], seeds: [0], arms: {../a: {}}}", "letters, digits and `_` only, at most 40, not `../a`."),
        ("{tasks: [cartpole], seeds: [0], arms: {a: {}, a: {sample: 1}}}", "`a` appears twice"),
        ("{tasks: [cartpole], seeds: [0], arms: {a: {sampel: 1}}}", "In `arms.a`: Unknown setting `sampel`."),
        ("{tasks: [cartpole], seeds: [0], arms: {a: {sample: many}}}", "`sample=many` does not fit"),
        ("{tasks: [cartpole], seeds: [0], arms: {a: {sample: [1]}}}", "a setting takes a text or a number."),
        ("{tasks: [cartpole], seeds: [0], arms: {a: {seed: 1}}}", "sets `seed`, which the plan sets for each cell"),
        ("{tasks: [cartpole], seeds: [0], arms: {a: {model: none}}}", "a bench compares searches."),
        (REST + "per_task: {cartpol: {}}}", "`cartpol`, which is not a task of the plan. Did you mean `cartpole`?"),
        (REST + "settings: {video: some}}", "`video` must be one of"),
        ("{tasks: [", "is not YAML"),
        ("[" * 3000, "is not YAML"),
    ],
)
def test_what_does_not_fit_is_one_sentence(tmp_path, text, says):
    with pytest.raises(ConfigError) as refused:
        load(written(tmp_path, text))
    assert says in str(refused.value) and str(refused.value).startswith(("The plan ", str(tmp_path)))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"arms": {"a": {"sampel": 8}}}, "Unknown setting `sampel`"),
        ({"arms": {"a": {"steps": "1e6"}}}, "`steps` takes a whole number"),
        ({"arms": {"a": {"seed": 3}}}, "`arms.a` sets `seed`, which the plan sets"),
        ({"arms": {"a": None}}, "`arms.a` must be a mapping of settings"),
        ({"arms": ["a"]}, "`arms` must be a mapping of names"),
        ({"tasks": "cartpole"}, "`tasks` must be a list of names"),
        ({"settings": 3}, "`settings` must be a mapping of settings"),
    ],
)
def test_a_plan_made_in_python_that_does_not_fit_is_one_sentence_too(changes, says):
    fits = {"tasks": ("cartpole",), "seeds": (0,), "arms": {"a": {"steps": 1e6}}}
    assert Plan(**fits).config(Cell("cartpole", "a", 0)).steps == 1_000_000
    with pytest.raises(ConfigError, match=re.escape(says)):
        Plan(**{**fits, **changes})


def test_an_arm_may_be_another_one_with_a_change(tmp_path):
    text = "tasks: [cartpole]\nseeds: [0]\narms: {a: &a {sample: 2, iteration: 3}, b: {<<: *a, iteration: 1}}\n"
    (tmp_path / "plan.yaml").write_text(text)
    arms = load(tmp_path / "plan.yaml").arms
    assert arms["b"] == {"sample": 2, "iteration": 1}


def test_seeds_that_a_tuning_takes_are_no_other_search_s():
    with pytest.raises(ConfigError, match="Choose seeds at least 7 apart"):
        Plan(tasks=("cartpole",), seeds=(0, 4), arms={"a": {}}, settings={"tune": 8, "model": "random", "seeds": 3})
    assert Plan(tasks=("cartpole",), seeds=(0, 4), arms={"a": {"seeds": 3}}).seeds == (0, 4)  # 0 to 3, and 4 to 7
    with pytest.raises(ConfigError, match="Choose seeds at least 6 apart"):
        Plan(tasks=("cartpole",), seeds=(0, 4), arms={"a": {"seeds": 3}, "b": {"seeds": 5}})


def test_a_plan_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ConfigError, match="Cannot read the plan"):
        load(tmp_path / "none.yaml")


def test_numbers_of_numpy_and_ranges_are_numbers():
    given = {"tasks": ["cartpole"], "seeds": range(0, 20, 10), "arms": {"a": {"sample": np.int64(4)}}}
    read = plan({**given, "settings": {"temperature": np.float32(0.5)}})
    assert read.seeds == (0, 10) and [read.config(cell).sample for cell in read.cells()] == [4, 4]
    made = Plan(tasks=("cartpole",), seeds=tuple(np.arange(2) * 10), arms={"a": {}})
    assert {type(cell.seed) for cell in made.cells()} == {int}


@pytest.mark.parametrize(("name", "first"), [("ablations", ["full", "random"]), ("population", ["best", "eureka"])])
def test_a_plan_of_the_repository_names_searches_that_exist(name, first):
    read = load(Path(__file__).parents[2] / "benchmarks" / "plans" / f"{name}.yaml")
    assert list(read.arms)[:2] == first
    for cell in read.cells():
        SEARCHES.find(read.config(cell).search)
