"""More rewards are asked for than train. Those that disagree with F go; of the rest, the most different stay."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np
import pytest
from loop.alone import Killed, run

from openeureka.config import RunConfig
from openeureka.errors import ConfigError
from openeureka.events import nobody
from openeureka.method.lanes import Lanes
from openeureka.method.sampling import Sampler
from openeureka.method.screen import Rated, choose, fill, rate
from openeureka.report.candidates import CandidateState
from openeureka.report.view import RunView
from openeureka.store import Store
from openeureka.strategies import make
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyTrainer, program, reply
from openeureka.types import Candidate, Episodes, Place, RewardGraph, lane_id

CONFIG = RunConfig(sample=2, iteration=2, screen=3, seeds=2, refill=0)
FIRST, SECOND = (4, 6), (2, 7, -3, 5, 7.5, 30)
"""Worths of the two rewards of generation 0, and of the six that are asked for in generation 1."""


def lane(worth: float) -> str:
    return lane_id(Candidate.of(program(worth)).id, 0)


def search(
    directory: Path, trainer: ToyTrainer, config: RunConfig = CONFIG, script: Sequence[float] = (*FIRST, *SECOND)
) -> ScriptedModel:
    with Store.open(directory, config) as store:
        model = ScriptedModel([reply(worth) for worth in script], said=len(store.talk.replies()))
        run(config, store, model, ToyChecker(), trainer, TOY, make(config))
    return model


def witnesses(*lanes: Sequence[float]) -> list[Episodes]:
    """Recorded episodes of lanes: for each F an episode of one step."""
    return [
        Episodes(fitness=tuple(own), steps=(1,) * len(own), owners=tuple(range(len(own))), states=b"") for own in lanes
    ]


def rated(slot: int, pay: Sequence[float], agreement: float | None = 1.0, prompt: int = 0) -> Rated:
    own = np.asarray(pay, dtype=float) - np.mean(pay)
    length = float(np.linalg.norm(own))
    return Rated(Place(1, slot), prompt, agreement, 0.05, own / length if length else None)


def test_agreement_is_the_rank_correlation_of_return_and_fitness():
    seen = witnesses([1.0, 2.0], [3.0, 4.0], [5.0, 6.0])
    assert rate(Place(1, 0), 0, [1, 8, 27, 64, 125, 216], seen).agreement == pytest.approx(1.0)
    # The returns have the ranks 2 1 4 3 6 5. Their squared distances sum to 6: 1 - 6 * 6 / (6 * 35).
    found = rate(Place(1, 0), 0, [20, 10, 40, 30, 60, 50], seen)
    assert found.agreement == pytest.approx(1 - 6 * 6 / (6 * 35))
    # Without any one of the lanes the ranks are 2 1 4 3: 1 - 6 * 4 / (4 * 15) = 0.6 each time, so there is no error.
    assert found.error == pytest.approx(0.0)
    assert rate(Place(1, 0), 0, [6, 5, 4, 3, 2, 1], seen).agreement == pytest.approx(-1.0)


def test_the_error_is_that_of_leaving_out_a_lane():
    seen = witnesses([1.0, 2.0], [3.0, 4.0], [5.0, 6.0])
    found = rate(Place(1, 0), 0, [1, 2, 3, 4, 0, -1], seen)
    # The returns have the ranks 3 4 5 6 2 1. Without the first lane these are 3 4 2 1, with squared distances 4 4 1 9:
    # 1 - 6 * 18 / 60 = -0.8. Without the second it is -0.8, too, without the third 1. Jackknife: the mean is -0.2, the
    # squared deviations are 0.36 0.36 1.44, times 2/3.
    assert found.error == pytest.approx(math.sqrt(2 / 3 * 2.16))


def test_a_return_counts_the_steps_that_were_thinned_away():
    seen = [Episodes(fitness=(1.0, 2.0, 3.0), steps=(10, 30, 20), owners=(0, 0, 1, 2), states=b"")]
    # Returns, as mean pay times steps: 1.5 * 10 = 15, 1 * 30 = 30 and 2 * 20 = 40.
    assert rate(Place(1, 0), 0, [1, 2, 1, 2], seen).agreement == pytest.approx(1.0)


def test_what_cannot_be_known_is_not_made_up():
    seen = witnesses([1.0, 2.0], [3.0])
    assert rate(Place(1, 0), 0, None, seen).pay is None
    assert rate(Place(1, 0), 0, [1.0], seen).agreement is None  # a number for each state is needed
    constant = rate(Place(1, 0), 0, [5.0, 5.0, 5.0], seen)
    assert (constant.agreement, constant.pay) == (None, None)
    level = rate(Place(1, 0), 0, [1.0, 2.0, 3.0], witnesses([1.0, 1.0], [1.0]))
    assert level.agreement is None and level.pay is not None
    undefined = Episodes(fitness=(None, 1.0), steps=(1, 1), owners=(0, 1), states=b"")
    assert rate(Place(1, 0), 0, [1.0, 2.0], [undefined]).agreement is None


def test_those_that_differ_most_from_what_trained_and_from_each_other_train():
    before = [rated(0, [1, 2, 3, 4])]
    same, close, across = rated(1, [2, 4, 6, 8]), rated(2, [1, 2, 4, 3]), rated(3, [1, -1, -1, 1])
    found = choose([same, close, across], before, [2])
    assert [found[Place(1, slot)].kept for slot in (1, 2, 3)] == [False, True, True]
    dropped = found[Place(1, 1)]
    assert dropped.nearest == Place(1, 0) and dropped.likeness == pytest.approx(1.0)
    assert dropped.reason == "it pays as g1s0 does (rank correlation 1.00), others differ more"


def test_of_equals_the_earlier_slot_trains():
    found = choose([rated(slot, [1, 2, 3]) for slot in range(3)], [], [1])
    assert [found[Place(1, slot)].kept for slot in range(3)] == [True, False, False]


def test_a_reward_that_pays_the_same_everywhere_comes_last():
    found = choose([rated(0, [1, 1, 1], None), rated(1, [1, 2, 3])], [rated(5, [1, 2, 3])], [1])
    assert not found[Place(1, 0)].kept and "the same in every recorded state" in found[Place(1, 0)].reason
    # Nothing is like it, either.
    (alone,) = choose([rated(1, [1, 2, 3])], [rated(5, [1, 1, 1], None)], [1]).values()
    assert alone.kept and alone.nearest is None


@pytest.mark.parametrize(
    ("agreements", "kept"),
    [
        ((0.95, 0.93, 0.2), [True, True, False]),  # 0.2 and two errors of 0.05 are below 0.93 - 0.3
        ((0.95, 0.93, 0.6), [True, False, True]),  # not clearly worse: then variety decides
        ((0.2, 0.1, -0.3), [True, True, False]),  # clearly below zero
        ((0.2, 0.1, -0.05), [True, False, True]),
        ((0.95, 0.93, None), [True, False, True]),
    ],
)
def test_agreement_only_drops_what_is_clearly_wrong(agreements: tuple[float | None, ...], kept: list[bool]):
    pays = ([1, 2, 3, 4], [1, 2, 3, 4.1], [1, -1, -1, 1])  # the third is the one that differs
    fresh = [rated(slot, pay, agreement) for slot, (pay, agreement) in enumerate(zip(pays, agreements, strict=True))]
    found = choose(fresh, [], [2])
    assert [found[Place(1, slot)].kept for slot in range(3)] == kept


def test_agreement_of_unknown_error_drops_nothing():
    few = replace(rated(2, [1, -1, -1, 1], -0.9), error=None)
    found = choose([rated(0, [1, 2, 3, 4], 0.95), rated(1, [1, 2, 3, 4.1], 0.93), few], [], [2])
    assert [found[Place(1, slot)].kept for slot in range(3)] == [True, False, True]


def test_of_many_recorded_lanes_some_from_the_worst_to_the_best_are_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    class Sees(ToyTrainer):
        def rewards(self, env, programs, episodes):
            seen.append([float(np.mean(own.fitness)) for own in episodes])
            return super().rewards(env, programs, episodes)

    seen: list[list[float]] = []
    search(tmp_path / "all", Sees())
    monkeypatch.setattr("openeureka.method.screen.WITNESSES", 3)
    search(tmp_path / "some", Sees())
    every, some = seen
    assert len(set(every)) == 4 and every == sorted(every)
    assert some == [every[0], every[2], every[3]]  # evenly spaced places 0, 1.5 and 3, rounded to even


def test_a_recorded_lane_with_an_undefined_f_stands_below_all_others(tmp_path: Path):
    """F of the human reward's policy (9) is defined in none of its episodes, of the sparse one's (4) only in one."""

    class Undefined(ToyTrainer):
        def evaluate(self, env, policies, **options):
            for score in super().evaluate(env, policies, **options):
                own, known = score.recorded, {"human": (None, None), "sparse": (None, 4.1)}
                fitness = known.get(score.lane.partition("-")[0])
                lost = replace(own, fitness=fitness) if own is not None and fitness else own
                yield replace(score, recorded=lost)

        def rewards(self, env, programs, episodes):
            seen.extend(own.fitness for own in episodes)
            return super().rewards(env, programs, episodes)

    seen: list[tuple[float | None, ...]] = []
    search(tmp_path / "run", Undefined())
    # The two candidates return 4 and 6. Played, a reward scores one less, and 0.1 more in its second episode.
    assert seen == [(None, None), (3.0, pytest.approx(3.1)), (None, 4.1), (5.0, pytest.approx(5.1))]


def test_a_generation_trains_no_less_than_without_a_screen():
    found = choose([rated(0, [1, 2], 0.9), rated(1, [1, 2], -0.9), rated(2, [1, 2], -0.4)], [], [2])
    assert [found[Place(1, slot)].kept for slot in range(3)] == [True, False, True]
    assert found[Place(1, 1)].reason == "agreement with F -0.90 ± 0.05, of others -0.40"


def test_every_prompt_has_its_share():
    fresh = [rated(slot, [1, 2, slot], prompt=slot // 3) for slot in range(6)]
    found = choose(fresh, [], [1, 2])
    assert sum(found[Place(1, slot)].kept for slot in range(3)) == 1
    assert sum(found[Place(1, slot)].kept for slot in range(3, 6)) == 2


def test_the_screen_is_open_until_something_played(tmp_path: Path):
    trainer = ToyTrainer()
    model = search(tmp_path / "run", trainer)
    view = RunView.read(tmp_path / "run")
    assert [len(generation.candidates) for generation in view.generations] == [2, 6]
    assert model.said == 8
    trained = [worth for worth in (*FIRST, *SECOND) if lane(worth) in trainer.trained]
    # F of episodes is 3 to 9.1. The rewards worth 2 and -3 pay less where F is higher; those worth 7 and 7.5 pay alike.
    assert set(FIRST) < set(trained) and len(trained) == 4
    assert lane(2) not in trainer.trained and lane(-3) not in trainer.trained
    states = {str(c.place): c.state for c in view.candidates}
    assert sum(state is CandidateState.SCREENED for state in states.values()) == 4
    wrong = next(c for c in view.candidates if c.program is not None and c.program == Candidate.of(program(-3)))
    assert wrong.verdict is not None and wrong.result is None
    assert wrong.verdict.findings[0].message.startswith("agreement with F -1.00 ± 0.00, of others ")
    assert wrong.feedback.startswith("The reward function was not trained: agreement with F -1.00")


def test_numbers_of_a_decision_are_rows(tmp_path: Path):
    search(tmp_path / "run", ToyTrainer())
    with Store.view(tmp_path / "run") as store:
        rows = store.screens.all()
    assert list(rows) == [Place(1, slot) for slot in range(6)]
    assert sum(row.kept for row in rows.values()) == 2
    assert rows[Place(1, 2)].agreement == pytest.approx(-1.0)
    assert rows[Place(1, 2)].error == pytest.approx(0.0, abs=1e-9)
    assert all((row.reason == "") == row.kept for row in rows.values())
    assert all(row.nearest is not None and row.likeness is not None for row in rows.values())


def test_a_run_without_a_screen_records_nothing(tmp_path: Path):
    class Old(ToyTrainer):
        """A trainer from before there were screens: it cannot record episodes."""

        def evaluate(self, env, policies, *, seed, episodes=0, dynamics=None, untrained=None):
            known = {"seed": seed, "episodes": episodes, "dynamics": dynamics, "untrained": untrained}
            return super().evaluate(env, policies, **known)

    search(tmp_path / "run", Old(), replace(CONFIG, screen=1), (*FIRST, *SECOND[:2]))
    assert not list((tmp_path / "run").rglob("episodes.frame"))


def test_a_given_reward_is_something_to_judge_by(tmp_path: Path):
    given = tmp_path / "reward.py"
    given.write_text(program(5))
    config = replace(CONFIG, init=str(given), iteration=1)
    search(tmp_path / "run", ToyTrainer(), config, SECOND)
    view = RunView.read(tmp_path / "run")
    assert [len(generation.candidates) for generation in view.generations] == [1, 6]


def test_a_program_that_comes_again_trains_no_second_time_and_takes_nobodys_place(tmp_path: Path):
    trainer = ToyTrainer()
    search(tmp_path / "run", trainer, script=(*FIRST, 4, 4, 7, 7, 2, 30))
    view = RunView.read(tmp_path / "run")
    states = [c.state for c in view.candidates][2:]
    assert states[:2] == [CandidateState.TRAINED] * 2 and states[2] is states[3]
    assert trainer.trained.count(lane(4)) == trainer.trained.count(lane(7)) == 1
    fresh = {c.program.id for c in view.candidates if c.generation and c.program and c.result}
    assert len(fresh - {Candidate.of(program(4)).id}) == 2


def test_damaged_episodes_are_no_evidence(tmp_path: Path):
    class Spoils(ToyTrainer):
        def rewards(
            self, env: str, programs: Mapping[str, RewardGraph], episodes: Sequence[Episodes]
        ) -> Mapping[str, Sequence[float]]:
            assert len(episodes) == 3  # of two candidates and two baselines, less the damaged one
            return {}

    config = replace(CONFIG, iteration=1)
    search(tmp_path / "run", ToyTrainer(), config)
    with Store.view(tmp_path / "run") as store:
        assert store.lanes.episodes("human-s0") is not None
    (tmp_path / "run" / "lanes" / "human-s0" / "episodes.frame").write_bytes(b"torn")
    with Store.open(tmp_path / "run", config) as store:
        model, lanes = ScriptedModel([reply(worth) for worth in SECOND]), Lanes(config, store, Spoils(), nobody)
        sampler = Sampler(config, store, model, ToyChecker(), TOY, nobody)
        history = store.history()
        samples = fill(1, make(config).ask(history, Random(0)), sampler, lanes, history)
    # Nothing is known about any reward, so none counts as wrong, and the earlier slots train.
    assert [sample.verdict.accepted for sample in samples] == [True, True, False, False, False, False]


class Dies(ToyTrainer):
    """Stands for a process that is killed after `left` calls of the trainer."""

    left: int = 0

    def _count(self):
        if not self.left:
            raise Killed
        self.left -= 1

    def result(self, lane):
        self._count()
        return super().result(lane)

    def evaluate(self, *args, **options):
        self._count()
        return super().evaluate(*args, **options)

    def rewards(self, env, programs, episodes):
        self._count()
        return super().rewards(env, programs, episodes)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str], int]:
    """A search that nobody kills, its lanes, and how many replies it asked for."""
    folder, trainer = tmp_path_factory.mktemp("whole"), ToyTrainer()
    return folder, trainer.trained, search(folder, trainer).said


@pytest.mark.parametrize("calls", [0, 3, 4, 5, 6, 7, 8, 9])
def test_a_run_that_is_killed_in_or_around_a_screen_goes_on_there(
    whole: tuple[Path, list[str], int], tmp_path: Path, calls: int
):
    first, second = Dies(), ToyTrainer()
    first.left = calls
    with pytest.raises(Killed):
        search(tmp_path / "run", first)
    model = search(tmp_path / "run", second)
    folder, lanes, asked = whole
    assert model.said == asked
    trained = first.trained + second.trained
    assert sorted(set(trained)) == sorted(lanes) and len(trained) <= len(lanes) + 1
    with Store.view(folder) as one, Store.view(tmp_path / "run") as other:
        assert one.screens.all() == other.screens.all()
        assert one.lanes.results() == other.lanes.results()
        assert one.talk.placed_replies() == other.talk.placed_replies()


def test_a_decision_stands_whatever_is_computed_later(tmp_path: Path):
    """Another machine may round differently, but it trains the rewards that were chosen."""

    class Elsewhere(ToyTrainer):
        def rewards(self, env, programs, episodes):
            raise AssertionError("it is decided")

    first = Dies()
    first.left = 7  # four lanes, two looks at their policies, the screen
    with pytest.raises(Killed):
        search(tmp_path / "run", first)
    with Store.view(tmp_path / "run") as store:
        decided = {place for place, one in store.screens.all().items() if one.kept}
    waiting = [c.state for c in RunView.read(tmp_path / "run").candidates if c.generation == 1]
    assert waiting.count(CandidateState.SCREENED) == 4 and waiting.count(CandidateState.ACCEPTED) == 2
    search(tmp_path / "run", Elsewhere())
    view = RunView.read(tmp_path / "run")
    assert {c.place for c in view.candidates if c.generation == 1 and c.result is not None} == decided


def test_settings_that_do_not_go_with_a_screen_are_refused():
    with pytest.raises(ConfigError, match="from 1 to 100,000"):
        RunConfig(screen=0)
    with pytest.raises(ConfigError, match="use it with search=best"):
        RunConfig(screen=2, search="eureka")
    with pytest.raises(ConfigError, match="use it with search=best"):
        RunConfig(screen=2, model="none")
