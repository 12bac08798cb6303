"""Candidates that trail are cut, and the run knows when and why."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from loop.alone import Killed, run

from openeureka.config import RunConfig
from openeureka.errors import ConfigError
from openeureka.events import nobody
from openeureka.method.lanes import Lanes, affordable
from openeureka.method.schedule import Rung, leaders, why
from openeureka.method.seeds import deal
from openeureka.report.candidates import CandidateState
from openeureka.report.view import RunView
from openeureka.store import Store
from openeureka.store.lane_log import LaneLog
from openeureka.strategies import make
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyTrainer, program, reply
from openeureka.types import Candidate, Evaluation, TrainingResult, TrainingState, lane_id

WORTHS = (3, 8, 1, 6, 5, 2, 7, 4)
CONFIG = RunConfig(sample=8, iteration=1, seeds=2, schedule="halving", refill=0)


def lane(worth: float) -> str:
    return lane_id(Candidate.of(program(worth)).id, 0)


def search(directory: Path, trainer: ToyTrainer, config: RunConfig = CONFIG) -> None:
    with Store.open(directory, config) as store:
        model = ScriptedModel([reply(worth) for worth in WORTHS], said=len(store.talk.replies()))
        run(config, store, model, ToyChecker(), trainer, TOY, make(config))


def score(fitness: float | None, **costs: float) -> Evaluation:
    return Evaluation(lane="-", fitness=fitness, episode_length=1.0, episodes=1, costs=costs)


def test_those_that_play_best_go_on():
    scores = {"a": score(1.0), "b": score(None), "c": score(3.0), "d": score(2.0), "e": score(3.0)}
    assert leaders(scores, Rung(1 / 4, 1 / 2), {}) == {"c", "d", "e"}
    assert leaders(scores, Rung(1 / 4, 0.2), {}) == {"c"}  # of equals the earlier one
    assert leaders({"b": score(None)}, Rung(1 / 4, 0.1), {}) == {"b"}
    assert why(Rung(1 / 8, 1 / 2), "d", scores, {}) == "after 0.125 of its steps, at place 3 of 5"


def test_who_breaks_a_limit_goes_on_after_those_who_keep_it():
    scores = {"a": score(9.0, torque=50.0), "b": score(1.0, torque=30.0), "c": score(8.0, torque=45.0)}
    assert leaders(scores, Rung(1 / 4, 1 / 3), {"torque": 40.0}) == {"b"}
    assert leaders(scores, Rung(1 / 4, 2 / 3), {"torque": 40.0}) == {"b", "c"}
    assert why(Rung(1 / 4, 1 / 2), "a", scores, {"torque": 40.0}).endswith("at place 3 of 3")
    assert leaders(scores, Rung(1 / 4, 1 / 3), {}) == {"a"}


class Late(ToyTrainer):
    """F is told only in the second half of a training, as where it averages over the steps of long episodes."""

    def _paused(self, lane, until):
        return replace(super()._paused(lane, until), fitness=None, best_fitness=None)


def test_those_that_are_cut_before_f_is_told_play_all_the_same(tmp_path: Path):
    search(tmp_path / "run", Late())
    candidates = {c.result.lane: c for c in RunView.read(tmp_path / "run").candidates if c.result is not None}
    cut = [candidates[lane(worth)] for worth in WORTHS if worth != 8]
    assert {c.state for c in cut} == {CandidateState.CUT} and {c.fitness for c in cut} == {None}
    assert [c.score for c in cut] == [worth - 1.0 for worth in WORTHS if worth != 8]


def test_a_quarter_of_the_candidates_goes_on_after_a_quarter(tmp_path: Path):
    trainer = ToyTrainer()
    search(tmp_path / "run", trainer, replace(CONFIG, schedule="quarter"))
    assert {worth: trainer.trained.count(lane(worth)) for worth in WORTHS if worth != 8} == {
        **dict.fromkeys((1, 2, 3, 4, 5, 6), 1),
        7: 2,
    }
    cut = [one.result.message for one in RunView.read(tmp_path / "run").candidates if one.result and one.result.message]
    assert len(cut) == 6 and "after 0.25 of its steps, at place 3 of 8" in cut


def test_half_of_the_candidates_go_on_at_each_rung_and_baselines_always(tmp_path: Path):
    trainer = ToyTrainer()
    search(tmp_path / "run", trainer)
    count = [trainer.trained.count(lane(worth)) for worth in WORTHS]
    assert dict(zip(WORTHS, count, strict=True)) == {1: 1, 2: 1, 3: 1, 4: 1, 5: 2, 6: 2, 7: 3, 8: 4}
    assert trainer.trained.count("human-s0") == trainer.trained.count("sparse-s0") == 4
    view = RunView.read(tmp_path / "run")
    ends = {c.result.lane: (c.state, c.result.message) for c in view.candidates if c.result is not None}
    assert ends[lane(8)] == (CandidateState.TRAINED, "")
    assert ends[lane(7)] == (CandidateState.CUT, "after 0.5 of its steps, at place 2 of 2")
    assert ends[lane(1)] == (CandidateState.CUT, "after 0.125 of its steps, at place 8 of 8")
    best = view.best
    assert best is not None and best.result is not None and best.result.lane == lane(8)
    assert "cut after 0.5 of its steps" in next(c.feedback for c in view.candidates if c.result.lane == lane(7))
    assert not list((tmp_path / "run").rglob("paused.frame"))


def test_a_program_that_comes_again_is_at_no_place_in_a_later_race(tmp_path: Path):
    model = ScriptedModel([reply(worth) for worth in (3, 8, 1, 6, 2, 5, 1, 9)])
    config = replace(CONFIG, sample=4, iteration=2)
    with Store.open(tmp_path / "run", config) as store:
        run(config, store, model, ToyChecker(), ToyTrainer(), TOY, make(config))
        results = store.lanes.results()
    assert results[lane(1)].message == "after 0.125 of its steps, at place 4 of 4"
    assert results[lane(2)].message == "after 0.125 of its steps, at place 3 of 3"  # 9, 5 and 2 raced, not the second 1


def test_final_trainings_are_whole(tmp_path: Path):
    trainer = ToyTrainer()
    search(tmp_path / "run", trainer)
    with Store.view(tmp_path / "run") as store:
        assert all(
            result.state is TrainingState.FINISHED
            for name, result in store.lanes.results().items()
            if store.lanes.all()[name].role == "final"
        )


class Dies(ToyTrainer):
    """Stands for a process that is killed after `left` lanes."""

    left: int = 0

    def _paused(self, lane, until):
        self._count()
        return super()._paused(lane, until)

    def result(self, lane):
        self._count()
        return super().result(lane)

    def _count(self):
        if not self.left:
            raise Killed
        self.left -= 1


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """A search that nobody kills, and its lanes."""
    folder, trainer = tmp_path_factory.mktemp("whole"), ToyTrainer()
    search(folder, trainer)
    return folder, trainer.trained


@pytest.mark.parametrize("lanes", [3, 10, 12, 17, 20, 25])
def test_a_run_that_is_killed_in_a_rung_goes_on_there(whole: tuple[Path, list[str]], tmp_path: Path, lanes: int):
    first, second = Dies(), ToyTrainer()
    first.left = lanes
    with pytest.raises(Killed):
        search(tmp_path / "run", first)
    search(tmp_path / "run", second)
    trained = first.trained[:-1] + second.trained  # all but the one it died in
    assert sorted(trained) == sorted(whole[1])
    with Store.view(whole[0]) as one, Store.view(tmp_path / "run") as other:
        assert one.lanes.rungs() == other.lanes.rungs()
        assert one.lanes.results() == other.lanes.results()


def test_a_run_that_is_killed_between_two_cuts_says_the_same_of_both(
    whole: tuple[Path, list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    keep, cuts = LaneLog.save_results, list[str]()

    def dying(log: LaneLog, results: Sequence[TrainingResult]) -> None:
        keep(log, results)
        cuts.extend(result.lane for result in results if result.state is TrainingState.CUT)
        if len(cuts) == 2:
            raise Killed

    with monkeypatch.context() as patched, pytest.raises(Killed):
        patched.setattr(LaneLog, "save_results", dying)
        search(tmp_path / "run", ToyTrainer())
    search(tmp_path / "run", ToyTrainer())
    with Store.view(whole[0]) as one, Store.view(tmp_path / "run") as other:
        assert one.lanes.results() == other.lanes.results()


def test_a_lane_that_ended_early_takes_few_episodes_from_the_others():
    def trained(steps: int) -> TrainingResult:
        curves = {"episode_length": (None, 40.0, 100.0, 60.0)}
        state = TrainingState.FINISHED
        return TrainingResult(lane="-", state=state, fitness=1.0, curves=curves, env_steps=steps, seconds=1.0)

    assert affordable([trained(120_000)] * 8, 3) == 20  # 2 looks x 3 policies x 20 episodes x 100 steps
    assert affordable([*[trained(120_000)] * 7, trained(0)], 3) == 17
    assert affordable([trained(120_000)] * 8, 1) == 60
    # At least 8, even if they take more than a tenth of the steps, and at most 64.
    assert (affordable([trained(1_000)] * 8, 3), affordable([trained(10**9)] * 8, 3)) == (8, 64)
    endless = replace(trained(120_000), curves={"episode_length": (None, None)})
    assert affordable([endless] * 8, 3) == 8  # no episode ended in the training, so its length is unknown


def test_a_look_on_the_way_costs_no_more_than_one_at_the_end(tmp_path: Path):
    class Counts(ToyTrainer):
        def result(self, lane):
            curves = {**super().result(lane).curves, "episode_length": (100.0,) * 3}
            return replace(super().result(lane), env_steps=120_000, curves=curves)

        def evaluate(self, env, policies, *, episodes=0, **options):
            played.append(len(policies) * episodes)
            return super().evaluate(env, policies, episodes=episodes, **options)

    played: list[int] = []
    search(tmp_path / "run", Counts())
    # Of 8 candidates and 2 baselines, first the newest policy of each plays 60 episodes, and 6 and 4 at later rungs.
    # In the end three policies of each play 20.
    assert played[:4] == [600, 360, 240, 600]


def test_a_lane_whose_state_was_lost_begins_anew(tmp_path: Path):
    class Alike(ToyTrainer):
        """In a population, either all lanes continue or all begin."""

        def train(self, env, lanes, budget):
            assert len({lane.paused is None for lane in lanes}) == 1
            yield from super().train(env, lanes, budget)

    first, second = Dies(), Alike()
    first.left = 10 + 3  # the first rung is decided, and three lanes have reached the second
    with pytest.raises(Killed):
        search(tmp_path / "run", first)
    kept = sorted((tmp_path / "run").rglob("paused.frame"))
    assert len(kept) > 1
    for path in kept[1:]:
        path.write_bytes(b"torn")
    search(tmp_path / "run", second)
    with Store.view(tmp_path / "run") as store:
        assert store.lanes.results()[lane(8)].state is TrainingState.FINISHED


def test_a_single_candidate_is_not_stopped_on_the_way(tmp_path: Path):
    config = replace(CONFIG, iteration=0)
    with Store.open(tmp_path / "run", config) as store:
        trainer = ToyTrainer()
        lanes = Lanes(config, store, trainer, nobody)
        graph = ToyChecker().check(Candidate.of(program(3))).graph
        assert graph is not None
        lanes.train(deal([("one", graph)], [0], "candidate"))
        assert trainer.trained == ["one-s0"]


def test_a_curriculum_is_no_place_for_rungs():
    with pytest.raises(ConfigError, match="leave one of them out"):
        RunConfig(schedule="halving", curriculum="spin")
    with pytest.raises(ConfigError, match="full, quarter, halving"):
        RunConfig(schedule="fast")


class _Diverging(ToyTrainer):
    """The reward worth 2 diverges before the first rung. `begun` has, for each lane that was trained, the share that it
    trains to, its id and the state that it begins from."""

    def __init__(self, stop: bool = False) -> None:
        super().__init__()
        self.stop, self.begun = stop, list[tuple[float, str, bytes | None]]()

    def train(self, env, lanes, budget):
        self.begun += [(budget.until, lane.id, lane.paused) for lane in lanes]
        for lane in lanes:
            result = self.result(lane)
            if lane.program not in ("human", "sparse") and result.fitness == 2:
                yield replace(result, state=TrainingState.DIVERGED, message="not a number", last=None)
            else:
                yield self._paused(lane, budget.until) if budget.until < 1 else result
        if self.stop:
            raise KeyboardInterrupt


def test_stopped_at_a_rung_where_one_rival_is_left_a_search_goes_on_from_there(tmp_path):
    def go(name: str, trainer: _Diverging) -> list[tuple[float, str, bytes | None]]:
        config = RunConfig(sample=2, iteration=1, repair=0, refill=0, seeds=1, schedule="halving")
        model = ScriptedModel([reply(2), reply(3)])
        with Store.open(tmp_path / name, config) as store:
            run(config, store, model, ToyChecker(), trainer, TOY, make(config))
        return trainer.begun

    whole = go("whole", _Diverging())
    stopped = _Diverging(stop=True)
    with pytest.raises(KeyboardInterrupt):
        go("stopped", stopped)
    assert {until for until, *_ in stopped.begun} == {0.125}
    assert [*stopped.begun, *go("stopped", _Diverging())] == whole
