from dataclasses import replace

from openeureka.report.tables import facts, generations, given, search, tiles
from openeureka.types import Candidate, Evaluation, Generation, History, Lane, Place, TrainingState

from .search import BASELINES, BEST, HISTORY, result, run, trained, view
from .test_verdict import ended


def test_a_generation_counts_slots_verdicts_replies_and_trained_slots():
    found = generations(run(HISTORY))
    first = dict(zip(found.titles, found.rows[0], strict=True))
    assert (first["slots"], first["trained"]) == ("3", "2")
    assert first["verdicts"] == "2 accepted, 1 refused"
    assert first["replies"] == "6"  # 1 + 2 + 3
    assert (first["best F"], first["mean F"]) == ("30", "20")  # (10 + 30) / 2
    assert first["environment steps"] == "200"  # 100 of each training
    assert found.note == "Of all slots, 67% trained."  # 4 of 6


def test_before_the_first_generation_no_share_trained():
    assert generations(run(History())).note == ""


def test_a_diverged_slot_without_a_score_counts_in_no_mean():
    assert generations(run(HISTORY)).rows[1][-4:] == ("1", "200", "20", "20")


def test_the_mean_of_a_generation_is_of_the_slots_that_its_best_is_one_of():
    """Of three slots, the one with 40 diverged, and the one with 10 breaks a limit, with falls of 0.9."""
    entries = [trained(0, slot, fitness) for slot, fitness in enumerate((40.0, 30.0, 10.0))]
    assert entries[0].result is not None
    entries[0] = replace(entries[0], result=replace(entries[0].result, state=TrainingState.DIVERGED))
    fallen = Evaluation(lane="x", fitness=10.0, episode_length=9.0, episodes=4, costs={"falls": 0.9})
    entries[2] = replace(entries[2], played=fallen)
    own = History((Generation(0, tuple(entries), limits={"falls": 0.5}),))
    assert generations(run(own)).rows[0][-4:] == ("2", "300", "40", "35")  # (40 + 30) / 2


def test_lanes_that_share_a_training_spend_its_steps_once():
    twins = (trained(0, 0, 10.0, source="same"), trained(0, 1, 10.0, source="same"))
    lanes = [entry.result for entry in (*twins, trained(0, 2, 5.0)) if entry.result is not None]
    history = History((Generation(0, (*twins, trained(0, 2, 5.0))),))
    said = tiles(run(history, [*lanes, *BASELINES]))
    assert [tile.more for tile in said if tile.name == "trainings"] == ["400 environment steps"]


def scored(generated: list[float], human: list[float]) -> dict[str, tuple[str, str]]:
    """The head of a run with these scores of fresh seeds, and a sparse reward that scores 0."""
    own = ended(generated, human)
    sparse = [Evaluation(lane=f"sparse-s{seed}", fitness=0.0, episode_length=9.0, episodes=4) for seed in (1, 2)]
    own = replace(own, evaluations={**own.evaluations, **{score.lane: score for score in sparse}})
    return {tile.name: (tile.value, tile.more) for tile in tiles(own)}


def test_the_head_shows_what_the_verdict_rests_on_and_a_score_only_where_it_is_decided():
    shown = scored([49.0, 51.0], [39.0, 41.0])
    assert shown["generated reward"] == ("50.0 ± 1.4", "F held out, 2 seeds") and "best F" not in shown
    assert shown["human reward"][0] == "40.0 ± 1.4"
    assert shown["score, held out"][0] == "1.25"  # 50 / 40
    assert "score, held out" not in scored([40.0, 42.0], [39.0, 41.0])
    before = {tile.name: (tile.value, tile.more) for tile in tiles(run(HISTORY, BASELINES))}
    assert before["best F"] == ("50", "g2s0, in training") and before["human reward"] == ("60", "F in training")
    assert "generated reward" not in before and tiles(run(HISTORY))[3] == ("human reward", "-", "")


def test_what_was_played_stands_beside_what_was_trained():
    played = [
        Evaluation(lane=lane, fitness=fitness, episode_length=9.0, episodes=4, error=0.5)
        for lane, fitness in ((Candidate.of(BEST).id, 44.0), ("human-s0", 58.0))
    ]
    own = replace(run(HISTORY, BASELINES), ranks="played", played={score.lane: score for score in played})
    best, *baselines = search(own).rows
    assert best == ("highest, g2s0", "44.00 ± 0.50", "50")
    assert baselines == [("human reward", "58.00 ± 0.50", "60"), ("sparse reward", "-", "20")]
    crowned = search(replace(own, crown=Place(0, 1))).rows  # with fresh seeds another one was better
    assert crowned == [best, ("winner, g0s1", "-", "30"), *baselines]


def test_given_rewards_are_told_as_far_as_they_are_trained():
    lanes = [Lane("mine", 0, "given"), Lane("mine", 1, "given"), Lane("mine", 2, "given"), Lane("mine", 3, "tuned")]
    done = [result("mine-s0", 10.0), replace(result("mine-s1", 12.0), seconds=3.0), result("mine-s3", 99.0)]
    held_out = [Evaluation(lane=f"mine-s{seed}", fitness=9.0, episode_length=7.0, episodes=4) for seed in (0, 1)]
    own = replace(run(History(), done, held_out), lanes={lane.id: lane for lane in lanes})
    # Both trained side by side, for 3 s. The mean of 10 and 12 is 11, their deviation sqrt(2).
    assert given(own).rows == [("mine", "11.0 ± 1.4", "9 ± 0", "7 ± 0", "-", "200", "3 s", "-")]


def test_a_candidate_with_the_program_of_an_earlier_one_is_its_twin():
    entries = (trained(0, 0, 10.0, source="same"), trained(0, 1, 5.0), trained(0, 2, 10.0, source="same"))
    own = run(History((Generation(0, entries),)))
    assert {str(place): str(first) for place, first in own.twins.items()} == {"g0s2": "g0s0"}


def test_a_candidate_tells_of_lost_episodes_and_of_a_veto_where_there_are_any():
    own = view(trained(0, 0, 10.0))
    played = Evaluation(lane="a", fitness=9.0, episode_length=7.0, episodes=4, error=0.5)
    whole = dict(facts(replace(own, played=played)).rows)
    assert whole["F when played"] == "9.00 ± 0.50, 4 episodes" and "vetoed by a person" not in whole
    lost = dict(facts(replace(own, played=replace(played, lost=2), vetoed=True)).rows)
    assert lost["F when played"] == "9.00 ± 0.50, 4 episodes, 2 more lost as the physics broke down"
    assert lost["vetoed by a person"] == "yes"
