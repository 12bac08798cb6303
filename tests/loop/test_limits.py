"""Costs of policies besides F, and limits to them, in a search with fakes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest
from report.scripted import search_in

from openeureka import strategies
from openeureka.cli.show import show
from openeureka.config import RunConfig
from openeureka.errors import ConfigError
from openeureka.events import Event
from openeureka.method.hacking import Kind
from openeureka.report import costs, html, tables
from openeureka.report.next_steps import commands
from openeureka.report.verdict import of_tuning, verdict
from openeureka.report.view import RunView
from openeureka.runs.run import Run
from openeureka.score import Outcome, played
from openeureka.store import Store, look
from openeureka.testing.scripted import ScriptedModel, ToyTrainer, reply
from openeureka.types import Evaluation


@dataclass
class Costly(ToyTrainer):
    """A policy of worth w takes a torque of 10 w, and `more` on top of it in held-out episodes."""

    more: float = 0.0

    def evaluate(self, env: str, policies: Any, *, seed: int, **options: Any) -> Iterator[Evaluation]:
        late = self.more if 1_000_000 < seed < 2_000_000 else 0.0
        for score in super().evaluate(env, policies, seed=seed, **options):
            torque = 10 * float(policies[score.lane]) + late
            yield replace(score, costs={"torque": torque, "falls": 0.25})


def test_a_reward_whose_policy_breaks_a_limit_cannot_win(tmp_path: Path) -> None:
    free = RunView.read(search_in(tmp_path / "free", [reply(7), reply(8)], trainer=Costly()))
    run = RunView.read(
        search_in(tmp_path / "run", [reply(7), reply(8)], trainer=Costly(), limits="torque=75 falls=0.5")
    )
    assert free.best is not None and free.best.played is not None and free.best.played.fitness == 7.0
    assert run.best is not None and run.best.played is not None and run.best.played.fitness == 6.0
    assert run.crown == run.best.place and run.outcome is not None and run.outcome.rivals == {}
    assert not [lane for lane in run.lanes.values() if lane.role == "final" and lane.reward == free.best.program.id]  # type: ignore[union-attr]
    found = costs.table(run)
    assert found.titles == ("costs when played", "F", "torque [N m], at most 75", "falls [share], at most 0.5")
    assert [row[0] for row in found.rows] == ["g0s0", "g0s1", "human reward", "sparse reward"]
    assert [row[2] for row in found.rows] == ["70", "80 BROKEN", "100 BROKEN", "50"]
    page = html.report(run, tmp_path / "run")
    assert "What each policy costs" in page and "80 BROKEN" in page and "What its policy costs" in page
    assert costs.facts(run.best.played).rows == [("torque [N m]", "70"), ("falls [share]", "0.25")]
    assert tables.generations(run).rows[0][-2:] == ("6", "6") and look(tmp_path / "run")[1].fitness == 6.0
    (row,) = (row for row in Run(tmp_path / "run").rows() if row["place"] == "g0s1" and row["role"] == "candidate")
    assert row["cost/torque"] == 80.0


def test_without_limits_costs_are_kept_and_of_them_the_model_hears_of_early_ends_alone(tmp_path: Path) -> None:
    plain = search_in(tmp_path / "plain", [reply(7), reply(8), reply(6), reply(9)], iteration=2)
    measured = search_in(tmp_path / "measured", [reply(7), reply(8), reply(6), reply(9)], iteration=2, trainer=Costly())
    with Store.view(plain) as one, Store.view(measured) as other:
        asked = {place: [m.content for m in prompt] for place, prompt in one.talk.prompts().items()}
        told = {place: [m.content for m in prompt] for place, prompt in other.talk.prompts().items()}
        assert "steps on average; 25% ended early.\n" in told[1, 0][-1]
        assert asked == {place: [x.replace("; 25% ended early", "") for x in parts] for place, parts in told.items()}
        assert [e.feedback for e in one.history().entries] == [e.feedback for e in other.history().entries]
        assert one.crown() == other.crown() and played(other.lanes.plays()["human-s0"], {}).costs["torque"] == 100.0
    assert costs.table(RunView.read(plain)).rows == []
    assert not any(row[0] == Kind.LIMITS for row in tables.exploits(RunView.read(plain)).rows)


def test_a_terminal_is_shown_the_costs_that_have_a_limit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    show(search_in(tmp_path / "free", [reply(7), reply(8)], trainer=Costly()))
    assert "costs when played" not in capsys.readouterr().out
    show(search_in(tmp_path / "run", [reply(7), reply(8)], trainer=Costly(), limits="torque=75"))
    printed = capsys.readouterr().out
    assert "torque [N m], at most 75" in printed and "falls" not in printed


def test_where_all_break_a_limit_nobody_wins_and_the_nearest_is_improved(tmp_path: Path) -> None:
    model = ScriptedModel([reply(9), reply(8), reply(8.5), reply(7.8)])
    directory = search_in(
        tmp_path / "run", [], model=model, trainer=Costly(), iteration=2, limits="torque=75", feedback="none"
    )
    asked = model.prompts[-1].messages
    assert "return 8\n" in asked[-2].content and "return 9" not in asked[-2].content
    assert "torque 80.00 of at most 75. It breaks a limit" in asked[-1].content
    run = RunView.read(directory)
    assert run.best is None and run.crown is None
    assert verdict(run) == "No reward won: every policy breaks a limit. The closest is g1s1: torque 78 N m, above 75."
    assert Run(directory).finished and not (directory / "best").exists()


def test_a_reward_that_breaks_a_limit_with_fresh_seeds_does_not_win(tmp_path: Path) -> None:
    """Seed 1 adds 0.01 to the worth. In the search the torque is 74.95, with the fresh seed 75.05."""
    told: list[Event] = []

    script, trainer = [reply(7.495), reply(5)], Costly()
    run = RunView.read(search_in(tmp_path / "run", script, trainer=trainer, tell=told.append, limits="torque=75"))
    assert told[-1] == Outcome(best=None)
    assert run.crown is None and "trained again with fresh seeds" in verdict(run)
    assert [command for command, _ in commands(run)] == ["eureka show DIR"]
    assert not verdict(replace(run, ended=False)).startswith("No reward won")  # a winner may still come
    assert Run(tmp_path / "run").finished


def test_a_winner_that_breaks_a_limit_in_the_end_is_flagged(tmp_path: Path) -> None:
    trainer = Costly(more=20.0)
    run = RunView.read(search_in(tmp_path / "run", [reply(7), reply(5)], trainer=trainer, limits="torque=75"))
    assert [sign.kind for sign in run.signs] == [Kind.LIMITS]
    assert "torque 90.1 N m, above 75" in run.signs[0].sentence


def test_of_a_lane_s_policies_one_that_keeps_the_limits_stands_for_it() -> None:
    def play(peak: Any, fitness: float, torque: float) -> Evaluation:
        return Evaluation(
            lane="a", fitness=fitness, episode_length=1.0, episodes=4, peak=peak, costs={"torque": torque}
        )

    plays = {"reward": [play("reward", 3.0, 90.0)], "last": [play("last", 2.0, 60.0), play("last", 2.0, 80.0)]}
    assert played(plays, {}).peak == "reward" and played(plays, {"torque": 75.0}).peak == "last"  # type: ignore[arg-type]
    assert played(plays, {"torque": 75.0}).costs == {"torque": 70.0}  # type: ignore[arg-type]
    # Where every policy breaks a limit, the one that is least beyond it stands for the lane, whatever its F.
    assert played(plays, {"torque": 65.0}).peak == "last"  # type: ignore[arg-type]


@pytest.mark.parametrize("limits", ["torque", "torque=", "torque=nan", "torque=-1", "torque=4O"])
def test_what_is_no_limit_is_refused(limits: str) -> None:
    with pytest.raises(ConfigError, match="is not a limit; write a cost and its maximum"):
        RunConfig(limits=limits)


def test_a_cost_that_is_limited_twice_is_refused() -> None:
    with pytest.raises(ConfigError, match="names `torque` twice"):
        RunConfig(limits="torque=40,falls=0,torque=50")


def test_limits_need_a_search_that_plays() -> None:
    with pytest.raises(ConfigError, match="search=best"):
        RunConfig(limits="torque=40", search="eureka")
    assert RunConfig(limits="torque=40, falls=0.1").cost_limits == {"torque": 40.0, "falls": 0.1}
    own = "openeureka.strategies.strategy:eureka"
    for key, value in (("limits", "torque=40"), ("screen", 2)):
        with pytest.raises(ConfigError, match=f"ranks by F in training, but `{key}=` needs played policies"):
            strategies.make(RunConfig(search=own, sample=2, **{key: value}))


@dataclass
class Hungry(Costly):
    """The torque is given by worth, rounded to two digits (40 for any other worth). Above 90, F is 3 higher."""

    torques: dict[float, float] = field(default_factory=dict)

    def evaluate(self, env: str, policies: Any, *, seed: int, **options: Any) -> Iterator[Evaluation]:
        for score in super().evaluate(env, policies, seed=seed, **options):
            torque = self.torques.get(round(float(policies[score.lane]), 2), 40.0)
            bonus = 3.0 if torque > 90.0 else 0.0
            yield replace(score, fitness=(score.fitness or 0.0) + bonus, costs={"torque": torque})


def test_of_the_winner_s_policies_one_that_keeps_the_limits_is_handed_over(tmp_path: Path) -> None:
    """The policy of one of three fresh seeds takes 95 and has the highest F. On average the three take 65."""
    trainer = Hungry(torques={7.0: 50.0, 7.01: 50.0, 7.02: 95.0, 7.03: 50.0})
    settings: dict[str, Any] = {"limits": "torque=75", "seeds": 3}
    run = RunView.read(search_in(tmp_path / "run", [reply(7), reply(5)], trainer=trainer, **settings))
    with Store.view(tmp_path / "run") as store:
        (kept, *_) = store.folders.held("best")
    assert run.crown is not None and run.evaluations[kept.lane].costs["torque"] == 50.0


class _Late(Costly):
    """A policy of a worth above 3.005 takes a torque of 13, any other 9. So the reward worth 3 takes 13 only with fresh
    seeds, which add at least 0.01."""

    def evaluate(self, env: str, policies: Any, *, seed: int, **options: Any) -> Iterator[Evaluation]:
        for score in super().evaluate(env, policies, seed=seed, **options):
            yield replace(score, costs={"torque": 9.0 if float(policies[score.lane]) < 3.005 else 13.0})


def test_fitted_numbers_that_keep_a_limit_replace_a_reward_that_breaks_it(tmp_path: Path) -> None:
    text = "```python\ndef compute_reward(x):\n    y = 2.0 * x\n    return 3.0 * y\n```"
    directory = search_in(tmp_path / "run", [text], trainer=_Late(), sample=1, seeds=2, tune=8, limits="torque=10")
    run = RunView.read(directory)
    found = run.tuned
    assert run.crown is None and found is not None and found.after
    before, after = found.finals["original"].scores, found.finals[found.after].scores
    assert min(before) > max(after)  # by F alone the original text would stay
    assert found.breach_before == "torque 13 N m, above 10" and not found.breach
    assert found.better == found.after and "return 3.0 * y" not in (directory / "best" / "reward.py").read_text()
    assert of_tuning(found).startswith("The tuned numbers win: policies of the original ones break a limit, torque 13")
