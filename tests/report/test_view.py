from contextlib import closing
from dataclasses import replace

import pytest

from openeureka.errors import StoreError
from openeureka.method import baselines
from openeureka.method.baselines import Baselines
from openeureka.report import tables
from openeureka.report.candidates import CandidateState
from openeureka.report.view import RunView
from openeureka.score import SeedScores
from openeureka.store import Store
from openeureka.testing.scripted import ScriptedModel, ToyTrainer, program, reply
from openeureka.types import Remark, RemarkKind

from .scripted import search_in

REFUSED = "```python\ndef compute_reward(x):\n    return x\n```"


class Interrupted(Exception):
    pass


class Interrupting(ScriptedModel):
    """Raises an exception where its script ends."""

    def sample(self, prompt, *, n, seed):
        for said in super().sample(prompt, n=n, seed=seed):
            yield said
            if self.said == len(self.script):
                raise Interrupted


class NeverTrains(ToyTrainer):
    def train(self, env, lanes, budget):
        raise Interrupted
        yield


def test_every_slot_has_its_state_its_program_and_what_it_cost(tmp_path):
    view = RunView.read(search_in(tmp_path / "run", [reply(7), REFUSED, reply(8)], refill=1))
    first, second = view.candidates
    assert (first.state, first.fitness, len(first.attempts)) == (CandidateState.TRAINED, 7.0, 1)
    assert (second.state, second.fitness, len(second.attempts)) == (CandidateState.TRAINED, 8.0, 2)
    assert second.program is not None and second.program.source == program(8)
    # The scripted model reads 100 tokens and writes 10 for a cent, each time.
    assert (second.usage.prompt_tokens, second.usage.completion_tokens, second.usage.cost_usd) == (200, 20, 0.02)
    assert view.best == second


def test_a_view_is_of_one_moment(tmp_path, monkeypatch):
    directory = search_in(tmp_path / "run", [reply(7), reply(8)])
    read = Store.history

    def meanwhile(store, results):
        with closing(Store.visit(directory)) as other:
            other.remarks.say(Remark(kind=RemarkKind.WORDS, text="too jerky"))
        return read(store, results)

    monkeypatch.setattr(Store, "history", meanwhile)
    assert RunView.read(directory).unheard == ()
    monkeypatch.undo()
    assert [remark.text for remark in RunView.read(directory).unheard] == ["too jerky"]


def test_refused_replies_keep_their_program_and_their_findings(tmp_path):
    view = RunView.read(search_in(tmp_path / "run", [REFUSED, "no code", reply(8)], sample=1, refill=2))
    verdicts = [attempt.verdict for attempt in view.candidates[0].attempts]
    assert [verdict.code for verdict in verdicts if verdict] == ["refused", "no_program", "accepted"]
    assert verdicts[0] is not None and verdicts[0].findings[0].rule == "no-number"
    refused = view.candidates[0].attempts[0].program
    assert refused is not None and "return x" in refused.source


def test_a_repair_shows_exactly_what_the_model_was_shown(tmp_path):
    model = ScriptedModel([REFUSED, reply(8)])
    view = RunView.read(search_in(tmp_path / "run", [], model=model, sample=1, repair=1))
    attempts = view.candidates[0].attempts
    assert [bool(attempt.repair) for attempt in attempts] == [False, True]
    prompt = view.generations[0].prompts[0].messages
    assert (*prompt, *attempts[1].repair) == model.prompts[1].messages


def test_the_parent_is_the_reward_that_the_prompt_asked_to_improve(tmp_path):
    view = RunView.read(search_in(tmp_path / "run", [reply(n) for n in (7, 9, 3, 4, 5, 6)], iteration=3))
    parents = [[c.parent and (c.parent.generation, c.parent.slot) for c in g.candidates] for g in view.generations]
    assert parents == [[None, None], [(0, 1), (0, 1)], [(0, 1), (0, 1)]]  # 9 stays the best
    greedy = RunView.read(
        search_in(tmp_path / "b", [reply(n) for n in (7, 9, 3, 4, 5, 6)], iteration=3, search="eureka")
    )
    assert [c.parent and (c.parent.generation, c.parent.slot) for c in greedy.generations[2].candidates] == [(1, 1)] * 2


def test_a_generation_under_way_shows_what_is_there(tmp_path):
    model = Interrupting([reply(7), reply(8), reply(9)])
    with pytest.raises(Interrupted):
        search_in(tmp_path / "run", [], model=model, iteration=2)
    first, second = RunView.read(tmp_path / "run").generations
    assert (first.finished, second.finished) == (True, False)
    assert [(c.slot, c.state) for c in second.candidates] == [(0, CandidateState.DRAWN)]
    assert second.candidates[0].parent is not None and second.candidates[0].parent.slot == 1


def test_a_checked_program_waits_for_its_training(tmp_path):
    with pytest.raises(Interrupted):
        search_in(tmp_path / "run", [reply(7), REFUSED], trainer=NeverTrains())
    states = [candidate.state for candidate in RunView.read(tmp_path / "run").candidates]
    assert states == [CandidateState.ACCEPTED, CandidateState.REFUSED]


def test_videos_are_found_where_they_lie(tmp_path):
    directory = search_in(tmp_path / "run", [reply(7), reply(8)])
    lane = RunView.read(directory).history.generations[0].entries[0].result
    assert lane is not None
    (directory / "lanes" / lane.lane / "video.mp4").write_bytes(b"mp4")
    first, second = RunView.read(directory).candidates
    assert (first.video, second.video) == (f"lanes/{lane.lane}/video.mp4", "")


def test_a_folder_that_is_no_run_says_so(tmp_path):
    with pytest.raises(StoreError, match="is not a run"):
        RunView.read(tmp_path)


def test_baselines_measured_beforehand_are_compared_with(tmp_path, monkeypatch):
    measured = Baselines(human=SeedScores(held_out=(10.0,)), sparse=SeedScores(held_out=(5.0,)), env_steps=1, worlds=1,
                         device="cpu", date="2026-01-31")  # fmt: skip
    monkeypatch.setattr(baselines, "chosen", lambda config: measured)
    view = RunView.read(search_in(tmp_path / "run", [reply(7), reply(8)], baselines="known"))
    assert view.outcome is not None
    assert view.outcome.normalised == pytest.approx((7.01 - 5) / (10 - 5))  # 8.01 with seed 1, one less held out
    note = tables.final(view, view.outcome).note
    assert measured.sentence() in note and "deterministic actions" in note
    scores = {lane: replace(score, noisy=True) for lane, score in view.evaluations.items()}
    noisy = tables.final(replace(view, evaluations=scores), view.outcome).note
    assert "actions keep the noise of training" in noisy and noisy.endswith("Those played without noise.")
