"""Runs begun from Python, with fakes for model, sandbox and trainer."""

import os
import signal
import sys
import threading
import time
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from report.policies import policy

import openeureka
from openeureka.cli.train import resume as resume_command
from openeureka.config import RobustConfig, RunConfig
from openeureka.errors import BudgetError, ConfigError, ModelError, RewardFileError, StoreError
from openeureka.film import mp4, video
from openeureka.method import baselines
from openeureka.runs import compose, rewards, trainers
from openeureka.runs import program as programs
from openeureka.store import Store, read_replies
from openeureka.store.directory import ask_to_stop
from openeureka.testing.scripted import ScriptedModel, ToyChecker, ToyTrainer, program, reply
from openeureka.training.policy import Policy
from openeureka.types import TrainingResult, TrainingState, Usage

SCRIPT = [reply(3.0), reply(8.0), reply(12.0), reply(4.0)]
SETTINGS = {"sample": 2, "iteration": 2, "seeds": 1, "video": "none"}
EVENTS = openeureka.Event.__args__


@pytest.fixture(autouse=True)
def trainer(monkeypatch: pytest.MonkeyPatch) -> ToyTrainer:
    """Replaces the trainer, the recorded states and the sandbox by pure functions. The trainer lists what trained."""
    toy = ToyTrainer()
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: toy)
    monkeypatch.setattr(compose, "record_states", lambda env: {})
    monkeypatch.setattr(rewards, "record_states", lambda env: {})
    for room in (compose, rewards):
        monkeypatch.setattr(room, "Sandbox", lambda *_, **__: nullcontext(ToyChecker()))
    return toy


def search(directory: Path, model=None, **settings) -> openeureka.Run:
    return openeureka.search(model=model or ScriptedModel(SCRIPT), dir=directory, **{**SETTINGS, **settings})


class Waiting(ScriptedModel):
    """Calls `act` before its third reply: Ctrl-C, unless a subclass does something else."""

    def sample(self, prompt, *, n, seed):
        if self.said == 2:
            self.act()
        yield from super().sample(prompt, n=n, seed=seed)

    def act(self) -> None:
        raise KeyboardInterrupt


def test_a_search_returns_a_run_with_all_that_it_found(tmp_path):
    run = search(tmp_path / "run")
    assert run == openeureka.open_run(str(tmp_path / "run")) and run.finished
    assert run.best_reward == program(12.0)
    # A toy's F held out is one less than in training, and the human reward is worth 10: 11.01 against 9.005.
    assert run.verdict.startswith("Not decided: F 11.01 (1 seed) against 9.005 (2 seeds), held out. One seed says")
    assert run.outcome.normalised == pytest.approx(1.4, abs=0.01)
    assert [len(generation.entries) for generation in run.history.generations] == [2, 2]
    assert [slot.score for slot in run.candidates] == [2.0, 7.0, 11.0, 3.0]
    assert run.report.is_file() and run.config.env == "cartpole"


def test_by_which_f_a_search_of_ones_own_ranks_is_kept(tmp_path):
    own = search(tmp_path / "own", search="openeureka.strategies.strategy:eureka")
    assert own.view.ranks == "training" and search(tmp_path / "run").view.ranks == "played"
    assert own.candidates[0].score == 3.0  # F in training; F played is one less


def test_lanes_are_rows_of_plain_values(tmp_path):
    run = search(tmp_path / "run")
    rows = {row["lane"]: row for row in run.rows()}
    assert list(rows) == list(run.lanes)
    assert {type(value) for row in rows.values() for value in row.values()} <= {str, int, float, type(None)}
    best = [row for row in rows.values() if row["place"] == "g1s0"]
    assert [(row["role"], row["seed"], row["fitness"]) for row in best] == [("candidate", 0, 12.0), ("final", 1, 12.01)]
    assert rows["human-s0"]["role"] == "baseline" and rows["human-s0"]["held_out_fitness"] == 9.0
    assert run.lanes["human-s0"].curves["human_reward"] == (0.0, 1.0, 2.0)


def test_events_are_told_in_order_and_a_loop_sees_the_same(tmp_path):
    told: list[openeureka.Event] = []
    run = search(tmp_path / "a", on_event=told.append)
    assert told[0] == openeureka.Started(run) and isinstance(told[-1], openeureka.Outcome)
    assert all(isinstance(event, EVENTS) for event in told)
    seen = list(openeureka.searching(model=ScriptedModel(SCRIPT), dir=tmp_path / "b", **SETTINGS))
    assert [type(event) for event in seen] == [type(event) for event in told]
    assert [e.slot for e in seen if isinstance(e, openeureka.Replied)] == [0, 1, 0, 1]
    assert openeureka.open_run(tmp_path / "b").finished


def test_events_that_nobody_asks_for_leave_no_directory(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    events = openeureka.searching(model=ScriptedModel(SCRIPT), **SETTINGS)
    assert not list(tmp_path.iterdir())
    assert next(events).run.directory.parent == tmp_path / "outputs"
    events.close()


def test_a_program_may_leave_its_working_directory_while_a_run_goes_on(tmp_path, monkeypatch, capsys):
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path)
    run = openeureka.search(
        model=ScriptedModel(SCRIPT), dir="run", on_event=lambda _: os.chdir(tmp_path / "elsewhere"), **SETTINGS
    )
    assert run.finished and run.best_reward == program(12.0) and not list((tmp_path / "elsewhere").iterdir())
    monkeypatch.chdir(tmp_path)
    opened = openeureka.open_run("run")
    assert opened == run == openeureka.open_run(tmp_path / "run")
    monkeypatch.chdir("/")
    assert opened.finished and opened.best_reward == program(12.0)


def test_a_home_directory_is_found_wherever_a_path_is_taken(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    search(Path("~/run"))
    assert openeureka.open_run("~/run").directory == tmp_path / "run"
    (tmp_path / "mine.py").write_text(program(3.0))
    assert openeureka.check("cartpole", "~/mine.py").accepted


def test_a_run_that_is_gone_is_not_called_unfinished(tmp_path):
    with pytest.raises(StoreError, match="is not a run"):
        _ = openeureka.Run(tmp_path / "gone").finished


def test_leaving_the_loop_stops_the_search_and_it_goes_on_later(tmp_path, capsys, trainer):
    model = ScriptedModel(SCRIPT)
    events = openeureka.searching(model=model, dir=tmp_path / "run", **SETTINGS)
    for event in events:
        if isinstance(event, openeureka.Generation):
            break
    events.close()
    run = openeureka.open_run(tmp_path / "run")
    assert not run.finished and not [t for t in threading.enumerate() if t.name == "openeureka"]
    before = list(trainer.trained)
    assert run.resume(model=model).finished
    assert model.said == 4  # no reply was asked for twice
    assert len(trainer.trained) == len(set(trainer.trained)) and trainer.trained[: len(before)] == before
    assert run.best_reward == program(12.0) and capsys.readouterr().out == ""


def test_a_loop_may_be_left_while_a_person_is_waited_for(tmp_path):
    settings = {**SETTINGS, "feedback": "human"}
    for event in openeureka.searching(model=ScriptedModel(SCRIPT), dir=tmp_path / "run", **settings):
        if event == openeureka.Began("feedback", generation=0):
            break
    assert not [thread for thread in threading.enumerate() if thread.name == "openeureka"]
    assert len(openeureka.open_run(tmp_path / "run").history.generations) == 1


@pytest.mark.parametrize("error", [ModelError("It failed."), ZeroDivisionError("It failed.")])
def test_what_ends_a_search_is_raised_in_the_loop(error, tmp_path):
    class Failing(Waiting):
        def act(self):
            raise error

    with pytest.raises(type(error), match="It failed") as failed:
        list(openeureka.searching(model=Failing(SCRIPT), dir=tmp_path / "run", **SETTINGS))
    assert failed.value.__notes__ == [
        f"What is done is kept. Continue with: openeureka.open_run('{tmp_path}/run').resume(model=...)"
    ]


def test_a_notebooks_stop_button_returns_the_run_so_far(tmp_path, capsys):
    class Interrupted(Waiting):
        def act(self):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(900)

    model = Interrupted(SCRIPT)
    run = search(tmp_path / "run", model)
    assert not run.finished and len(run.history.generations) == 1
    said = capsys.readouterr().out.splitlines()
    again = f"Stopped, nothing is lost. Continue with: openeureka.open_run('{tmp_path}/run').resume(model=...)"
    assert said[-1] == again
    assert not run.resume(model=model).finished  # stopped before its third reply once more
    assert capsys.readouterr().out.splitlines()[-1] == again
    assert run.resume(model=ScriptedModel(SCRIPT[2:])).finished


def test_a_model_that_has_a_name_is_not_asked_for_when_a_run_goes_on(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(compose, "open_model", lambda config, held: Waiting(SCRIPT))
    openeureka.search(model="random", dir=tmp_path / "run", **SETTINGS)
    assert capsys.readouterr().out.splitlines()[-1].endswith(".resume()")


def test_ctrl_c_ends_a_loop_that_waits_for_an_event(tmp_path, capsys, monkeypatch):
    main, told, seen, hosts = threading.get_ident(), [], [], []

    class Host(programs.Program):
        def __init__(self, tell, leaving, own):
            super().__init__(lambda event: (told.append(event), tell(event)), leaving, own)
            hosts.append(self)

    class Slow(Waiting):
        def act(self):
            while len(seen) < len(told) or sys._current_frames()[main].f_code.co_name != "followed":
                time.sleep(0.01)
            os.kill(os.getpid(), signal.SIGINT)  # goes to the main thread, which is waiting
            hosts[0].leaving.wait()

    monkeypatch.setattr(programs, "Program", Host)
    for event in openeureka.searching(model=Slow(SCRIPT), dir=tmp_path / "run", **SETTINGS):
        seen.append(event)
    assert not isinstance(seen[-1], openeureka.Outcome)
    assert "Stopped, nothing is lost." in capsys.readouterr().out
    assert not openeureka.open_run(tmp_path / "run").finished


def test_ctrl_c_before_anything_is_made_is_ctrl_c(tmp_path, monkeypatch):
    def interrupt(env):
        raise KeyboardInterrupt

    monkeypatch.setattr(compose, "record_states", interrupt)
    with pytest.raises(KeyboardInterrupt):
        search(tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_search_in_another_thread_is_stopped_by_eureka_stop(tmp_path, capsys):
    class Asked(Waiting):
        def act(self):
            ask_to_stop(tmp_path / "run")

    found: list[openeureka.Run] = []
    thread = threading.Thread(target=lambda: found.append(search(tmp_path / "run", Asked(SCRIPT))))
    thread.start()
    thread.join()
    assert not found[0].finished and "Stopped, nothing is lost." in capsys.readouterr().out


def test_a_callback_that_raises_ends_the_search_and_loses_nothing(tmp_path):
    def tell(event):
        if isinstance(event, openeureka.Generation):
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        search(tmp_path / "run", on_event=tell)
    assert len(openeureka.open_run(tmp_path / "run").history.generations) == 1


def test_a_run_begun_here_goes_on_at_the_command_line(tmp_path, monkeypatch, capsys):
    search(tmp_path / "run", Waiting(SCRIPT))
    monkeypatch.setattr(compose, "open_model", lambda config, held: ScriptedModel(SCRIPT[2:]))
    resume_command([f"{tmp_path}/run"])
    assert openeureka.open_run(tmp_path / "run").finished


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"sampel": 2}, "Unknown setting `sampel`. Did you mean `sample`?"),
        ({"sample": "two"}, "`sample=two` does not fit: `sample` takes a whole number, such as 8 or 1e6."),
        ({"sample": True}, "`sample=True` does not fit"),
        ({"sample": 1.5}, "`sample=1.5` does not fit"),
        ({"video": "some"}, "`video` must be one of"),
        ({"base_url": "http://x/v1", "model": "local"}, "does not use base_url="),
    ],
)
def test_settings_that_do_not_fit_are_refused_as_on_the_command_line(tmp_path, settings, sentence):
    with pytest.raises(ConfigError) as refused:
        openeureka.search(**{"model": "random", "dir": tmp_path / "run", **settings})
    assert sentence in str(refused.value) and not (tmp_path / "run").exists()


def test_baselines_that_nobody_measured_stop_a_run_before_it_begins(tmp_path, monkeypatch):
    monkeypatch.setattr(baselines, "known", lambda env, *, played: None)
    model = ScriptedModel(SCRIPT)
    with pytest.raises(ConfigError, match="use baselines=train"):
        search(tmp_path / "run", model, baselines="known")
    assert model.said == 0 and not (tmp_path / "run").exists()


def test_the_model_of_a_search_that_is_refused_is_closed(tmp_path):
    model = ScriptedModel(SCRIPT)
    with pytest.raises(ConfigError, match="There is no search `bst`"):
        search(tmp_path / "run", model, search="bst")
    assert model.closed == 1 and not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (
            lambda: openeureka.search(model=None),
            "`model` takes an object with name, style, sample, close; NoneType has no name, style, sample, close.",
        ),
        (lambda: openeureka.searching(model=5), "`model` takes an object with name"),
        (lambda: openeureka.robust("x", model=5), "`model` takes an object with name"),
        (
            lambda: openeureka.train("ant", 3),
            "`reward=3` does not fit: `reward` takes names, paths and texts of programs.",
        ),
        (lambda: openeureka.train("ant", ["human", None]), "`reward=None` does not fit"),
        (
            lambda: openeureka.tune("ant", None),
            "`reward=None` does not fit: `reward` takes a name, a path or the text of a program.",
        ),
        (lambda: openeureka.robust(3), "`run=3` does not fit: `run` takes a run or the path of its directory."),
        (lambda: openeureka.open_run(3), "`directory=3` does not fit: `directory` takes the path of a run."),
        (
            lambda: openeureka.check("ant", 7),
            "`program=7` does not fit: `program` takes a path or the text of a program.",
        ),
        (lambda: openeureka.Run(Path("x")).resume(model="random"), "`model` takes an object with name, style"),
    ],
)
def test_what_is_of_another_kind_is_refused_in_one_sentence(call, sentence):
    with pytest.raises(ConfigError, match=r"^[^\n]*$") as refused:
        call()
    assert str(refused.value).startswith(sentence)


def test_settings_may_be_paths_and_large_numbers_as_people_write_them(tmp_path, monkeypatch):
    (tmp_path / "mine.py").write_text(program(9.0))
    monkeypatch.chdir(tmp_path)
    run = search(tmp_path / "run", init=Path("mine.py"), steps=np.float64(1e6), max_cost=np.int64(5), price="0,0")
    assert (run.config.init, run.config.steps) == (f"{tmp_path}/mine.py", 1_000_000)
    assert type(run.config.steps) is int and type(run.config.max_cost) is float


def test_a_model_that_is_an_object_costs_what_price_says(tmp_path):
    def counting() -> ScriptedModel:
        return ScriptedModel(SCRIPT, usage=Usage(prompt_tokens=10_000, completion_tokens=5_000))

    # 10,000 tokens at 2 $/M and 5,000 at 4 $/M: 0.02 + 0.02, four times
    run = search(tmp_path / "run", counting(), price="2,4", max_cost=1.0)
    assert sum(reply.usage.cost_usd for reply in read_replies(run.directory)) == pytest.approx(0.16)
    with pytest.raises(BudgetError, match=r"max_cost=0\.1: 0\.08 are spent"):
        search(tmp_path / "stopped", counting(), price="2,4", max_cost=0.1)
    with pytest.raises(ConfigError, match=r"The price of scripted is not known.*, or price=0,0 if"):
        search(tmp_path / "refused", counting(), max_cost=1.0)
    assert not (tmp_path / "refused").exists()


def test_rewards_are_trained_by_name_by_path_and_as_text(tmp_path, trainer, monkeypatch):
    monkeypatch.setattr(rewards, "judge", lambda env, programs, **_: [ToyChecker().check(p) for p in programs])
    (tmp_path / "mine.py").write_text(program(7.0))
    run = openeureka.train(
        reward=["human", tmp_path / "mine.py", f"Here it is.\n\n{reply(9.0)}"], seeds=2, dir=tmp_path / "run"
    )
    assert run.finished and run.outcome is None
    rows = [(row["reward"], row["seed"], row["held_out_fitness"]) for row in run.rows()]
    assert rows[:4] == [("human", 0, 9.0), ("human", 1, 9.01), ("mine", 0, 6.0), ("mine", 1, 6.01)]
    assert rows[4:] == [("reward_3", 0, 8.0), ("reward_3", 1, 8.01)]
    assert run.verdict.startswith("human is better than reward_3: F 9.005")
    assert run.resume().finished and len(trainer.trained) == 6
    with pytest.raises(RewardFileError, match="reward_1 was refused: line 1: nothing is returned"):
        openeureka.train(reward="def f(x):\n    return x\n")
    with pytest.raises(ConfigError, match="names nothing to train"):
        openeureka.train(reward=[])
    listed = openeureka.train(reward="sparse, human", dir=tmp_path / "b")
    assert list(listed.lanes) == ["sparse-s0", "human-s0"]


def test_a_training_that_left_no_policy_is_over_all_the_same(tmp_path, trainer, monkeypatch):
    def diverging(env, specs, budget):
        for spec in specs:
            yield TrainingResult(
                lane=spec.id, state=TrainingState.DIVERGED, fitness=None, curves={}, env_steps=1, seconds=0.0
            )

    monkeypatch.setattr(trainer, "train", diverging)
    assert openeureka.train(dir=tmp_path / "run").finished


def test_a_finished_search_by_a_grammar_model_of_ones_own_goes_on_with_the_same_words(tmp_path, monkeypatch):
    model = ScriptedModel([reply(float(number)) for number in range(1, 25)], style="grammar")
    replayed = compose.open_model

    def opened(config, held):
        return replayed(config, held=held) if config.model.startswith("replay:") else model

    monkeypatch.setattr(compose, "open_model", opened)
    words = {"model": "own.py:make", "dir": tmp_path / "run", "seeds": 1, "video": "none"}
    assert openeureka.search(**words).finished and model.said == 24  # 3 generations of 8
    assert openeureka.search(**words).finished and model.said == 24


def test_more_epochs_than_a_row_can_hold_are_refused_before_they_train(tmp_path):
    with pytest.raises(ConfigError, match=r"^100,000,000 steps in 1 worlds are 6,250,000 epochs[^\n]*more worlds="):
        openeureka.train(dir=tmp_path / "run", steps=1e8, worlds=1)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"polish": 1, "polish_steps": 10**9}, "are 3,906,250 epochs.* or fewer polish_steps="),
        ({"curriculum": "stages.yaml"}, "are 3,906,250 epochs.* or fewer steps= or `steps:` of its stage"),
    ],
)
def test_so_are_those_of_what_follows_a_search_and_of_stages(tmp_path, monkeypatch, settings, sentence):
    """More epochs than a row can hold are refused before the executor is made, as this may start a cluster."""
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: pytest.fail("an executor was made"))
    (tmp_path / "stages.yaml").write_text("- {steps: 1e9}\n- {}\n")
    if "curriculum" in settings:
        settings = {**settings, "curriculum": str(tmp_path / "stages.yaml")}
    with pytest.raises(ConfigError, match=sentence):
        trainers.trainer_of(RunConfig(env="cartpole", worlds=16, **settings), tmp_path)


def test_so_are_those_of_robust_policies(tmp_path, monkeypatch):
    monkeypatch.setattr(compose, "planned", lambda store, start, steps: SimpleNamespace(steps=steps))
    monkeypatch.setattr(compose.Store, "view", lambda directory: nullcontext())
    config = RunConfig(env="cartpole", worlds=1, steps=1000, model="random")
    with pytest.raises(ConfigError, match=r"are 6,250,000 epochs.* or fewer steps="):
        compose.robust(RobustConfig(steps=10**8), config, tmp_path, SimpleNamespace(), again="")


def test_a_training_that_is_stopped_goes_on(tmp_path, trainer, capsys):
    def tell(event):
        if isinstance(event, openeureka.TrainingResult) and event.state is TrainingState.FINISHED:
            raise KeyboardInterrupt

    run = openeureka.train(dir=tmp_path / "run", on_event=tell)
    assert not run.finished and list(run.rows()[0])[:2] == ["lane", "reward"]
    assert run.resume().finished and sorted(trainer.trained) == ["human-s0", "sparse-s0"]
    assert run.best_reward is None  # the human one comes with the task


def test_a_training_that_is_killed_when_it_was_scored_is_not_done(tmp_path, trainer, monkeypatch):
    def killed(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Store, "save_best", killed)
        run = openeureka.train(reward=["human", program(7.0)], dir=tmp_path / "run")
    assert run.rows()[0]["held_out_fitness"] is not None and not run.finished
    assert run.resume().finished and len(trainer.trained) == 2


def test_a_training_that_is_stopped_in_its_report_is_done(tmp_path, trainer, capsys, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as once:
        once.setattr(compose, "build", interrupt)
        run = openeureka.train(dir=tmp_path / "run")
    said = f"Stopped; the training is done. Write its report with: eureka report {tmp_path}/run\n"
    assert run.finished and capsys.readouterr().out == said


def test_a_program_of_one_line_is_not_split_at_its_commas():
    with pytest.raises(RewardFileError, match="reward_1 was refused"):
        openeureka.train("cartpole", "def compute_reward(pole_angle, no_such): return pole_angle, {}")


def test_a_program_is_checked_as_text_or_file(tmp_path):
    assert openeureka.check("cartpole", program(3.0)).accepted
    (tmp_path / "bad.py").write_text("def f(x):\n    return x\n")
    verdict = openeureka.check("cartpole", tmp_path / "bad.py")
    assert not verdict.accepted and verdict.findings[0].rule == "no-number"
    with pytest.raises(RewardFileError, match="Cannot read the reward file"):
        openeureka.check("cartpole", "none.py")
    told = openeureka.check("cartpole", "def compute_reward(pole_angle): return pole_angle, {}")
    assert told.findings[0].rule == "no-number"  # taken as a program, not as a file name


def test_what_is_no_run_is_said(tmp_path):
    with pytest.raises(StoreError, match="is not a run"):
        openeureka.open_run(tmp_path)


@pytest.fixture
def trained(tmp_path) -> openeureka.Run:
    """A run whose best policy is a network."""
    run = search(tmp_path / "run")
    (run.directory / "best" / "policy.safetensors").write_bytes(
        Policy("cartpole", policy(4, 1, (8,)).tensors).to_bytes()
    )
    return run


def test_the_policy_is_a_function_of_arrays(trained):
    act = trained.policy
    one, many = act([0.1, 0.2, 0.3, 0.4]), act(np.array([[0.1, 0.2, 0.3, 0.4], [9.0, 0.0, 0.0, 0.0]]))
    assert one.shape == (1,) and many.shape == (2, 1) and one.dtype == np.float32
    assert np.array_equal(one, many[0]) and (abs(many) <= 1.0).all()
    assert act([0.0, 0.0, 5.0, 0.0]) == act([0.0, 0.0, 12.0, 0.0])  # Cartpole clips its observations at 5
    assert act == act and act != trained.policy
    with pytest.raises(ValueError, match=r"observations are \(4,\) or \(N, 4\), not \(3,\)"):
        act([0.0] * 3)


def test_frames_are_those_of_the_film(trained, monkeypatch):
    def render(env, data, *, seconds, seed):
        assert (env, seconds, seed) == ("cartpole", 0.2, 7) and Policy.from_bytes(data).env == "cartpole"
        levels = (0, 50, 100, 150, 200, 250)
        return mp4.encode((np.full((48, 64, 3), level, np.uint8) for level in levels), rate=30)

    monkeypatch.setattr(video, "render", render)
    assert len(trained.play(seconds=np.float64(0.2), seed=7)) == 6
    frames = trained.play(seconds=0.2, seed=7)
    assert frames.shape == (6, 48, 64, 3) and frames.dtype == np.uint8
    assert frames.mean(axis=(1, 2, 3)) == pytest.approx([0, 50, 100, 150, 200, 250], abs=4)
    for seconds in (0.0, 121.0, float("nan")):
        with pytest.raises(ConfigError, match="`seconds` must be above 0"):
            trained.play(seconds=seconds)


def test_a_run_from_elsewhere_is_read_and_reaches_nothing_unasked(tmp_path, monkeypatch):
    (tmp_path / "evil.py").write_text(f"open({str(tmp_path / 'mark')!r}, 'w')\n")
    config = RunConfig(env=f"{tmp_path}/evil.py", model="m", base_url="http://127.0.0.1:9/v1", **SETTINGS)
    Store.open(tmp_path / "run", config).close()
    run = openeureka.open_run(tmp_path / "run")
    assert run.rows() == [] and not run.finished and run.best_reward is None
    with pytest.raises(StoreError, match="has no policy yet"):
        _ = run.policy
    with pytest.raises(ConfigError, match="is not an installed task and was never typed here"):
        run.play()
    with pytest.raises(ConfigError, match=r"base_url=http://127.0.0.1:9/v1\. .* call resume\(trust=True\)"):
        run.resume()
    assert not (tmp_path / "mark").exists()
