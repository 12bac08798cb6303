import dataclasses
import json
import math
import multiprocessing
import sqlite3
from pathlib import Path

import pytest

from openeureka.codec import encode
from openeureka.config import RunConfig
from openeureka.errors import StoreError
from openeureka.store import Store, has_begun, read_config, read_replies
from openeureka.store.db import Database
from openeureka.store.rows import encode_result
from openeureka.testing.scripted import program
from openeureka.types import (
    Candidate,
    Checkpoint,
    Evaluation,
    Finding,
    Generation,
    Message,
    Node,
    Prompt,
    Reply,
    RewardGraph,
    Sample,
    Scored,
    TrainingResult,
    TrainingState,
    Usage,
    Verdict,
    VerdictCode,
)

CONFIG = RunConfig(env="ant", sample=2, iteration=1)
CANDIDATE = Candidate.of(program(1))
GRAPH = RewardGraph(
    nodes=(
        Node("input", ("speed",)),
        Node("sum.dim_IntList", ({"ref": 0}, (-1, 2)), {"keepdim": False}),
        Node("full.default", (({"n": 1},), math.inf)),
    ),
    reward=1,
    components=(("speed", 1),),
)
ACCEPTED = Verdict(candidate=CANDIDATE.id, code=VerdictCode.ACCEPTED, graph=GRAPH, seconds=0.5)
REPLY = Reply(text="text", model="m", usage=Usage(prompt_tokens=3, completion_tokens=2, cost_usd=0.25), seconds=1.5)


def result(lane: str, fitness: float | None = 2.0) -> TrainingResult:
    return TrainingResult(
        lane=lane,
        state=TrainingState.FINISHED,
        fitness=fitness,
        curves={"fitness": (None, 2.0), "component/speed": (0.5, math.nan)},
        env_steps=64,
        seconds=3.0,
        correlation=0.25,
        best_fitness=Checkpoint(epoch=1, value=2.0, policy=b"peak of F"),
        best_reward=None,
    )


@pytest.fixture
def store(tmp_path: Path):
    with Store.open(tmp_path / "run", CONFIG) as opened:
        yield opened


def test_the_settings_of_a_run_can_be_read_back(store: Store) -> None:
    assert read_config(store.directory) == CONFIG


def test_a_reply_comes_back_as_it_was(store: Store) -> None:
    store.talk.save_reply(0, 1, 2, REPLY)
    assert store.talk.reply(0, 1, 2) == REPLY
    assert store.talk.reply(0, 1, 1) is None


def test_a_hostile_reply_is_made_storable(store: Store) -> None:
    hostile = "a\0b \ud800 \N{GREEK SMALL LETTER PI}" + "x" * 2**21
    store.talk.save_reply(0, 0, 0, dataclasses.replace(REPLY, text=hostile))
    kept = store.talk.reply(0, 0, 0)
    assert kept is not None
    assert kept.text.startswith("a\N{REPLACEMENT CHARACTER}b ? \N{GREEK SMALL LETTER PI}x")
    assert len(kept.text) == 2**20


def test_replies_are_read_in_the_order_of_asking_whatever_order_they_arrived_in(store: Store) -> None:
    for place in ((0, 0, 1), (0, 1, 0), (0, 0, 0), (1, 0, 0)):
        store.talk.save_reply(*place, dataclasses.replace(REPLY, text=str(place)))
    texts = [reply.text for reply in read_replies(store.directory)]
    assert texts == ["(0, 0, 0)", "(0, 0, 1)", "(0, 1, 0)", "(1, 0, 0)"]


def test_usage_is_the_sum_over_replies(store: Store) -> None:
    store.talk.save_reply(0, 0, 0, REPLY)
    store.talk.save_reply(0, 0, 1, REPLY)
    assert store.talk.usage() == Usage(prompt_tokens=6, completion_tokens=4, cost_usd=0.5)


def test_a_verdict_comes_back_with_its_graph(store: Store) -> None:
    store.rewards.save_verdict(CANDIDATE, ACCEPTED, REPLY)
    assert store.rewards.verdict(CANDIDATE.id) == ACCEPTED
    folder = store.directory / "candidates" / CANDIDATE.id
    assert (folder / "reward.py").read_text() == CANDIDATE.source
    assert (folder / "reply.txt").read_text() == "text"
    assert json.loads((folder / "verdict.json").read_text())["code"] == "accepted"


def test_a_refusal_comes_back_with_its_findings(store: Store) -> None:
    findings = (Finding(rule="r", message="m \ud800", fix="f", line=3), Finding(rule="s", message="n"))
    refused = Verdict(candidate=CANDIDATE.id, code=VerdictCode.REFUSED, findings=findings)
    store.rewards.save_verdict(CANDIDATE, refused, REPLY)
    assert store.rewards.verdict(CANDIDATE.id) == refused


def test_a_result_comes_back_with_undefined_numbers_as_none_and_its_policies_apart(store: Store) -> None:
    store.lanes.save_results([result("human-s0", fitness=math.nan)])
    kept = store.lanes.result("human-s0")
    assert kept is not None
    assert kept.fitness is None
    assert kept.curves == {"fitness": (None, 2.0), "component/speed": (0.5, None)}
    assert kept.best_fitness == Checkpoint(epoch=1, value=2.0, policy=b"")
    assert kept.best_reward is None
    assert store.lanes.policy("human-s0", "fitness") == b"peak of F"
    assert store.lanes.policy("human-s0", "reward") is None


def test_the_clock_of_a_training_is_kept_and_an_older_result_has_none(store: Store) -> None:
    timed = dataclasses.replace(result("a"), clock=(1.5, 3.0))
    store.lanes.save_results([timed])
    older = json.loads(encode_result(result("b")))
    del older["clock"]
    store._database.put("results", {"lane": "b", "fitness": 2.0, "result": json.dumps(older)})
    assert {lane: kept.clock for lane, kept in store.lanes.results().items()} == {"a": (1.5, 3.0), "b": ()}


def test_an_undefined_fitness_is_null_in_the_tables(store: Store) -> None:
    store.lanes.save_results([result("a", fitness=math.inf)])
    store.lanes.save_evaluations([Evaluation(lane="a", fitness=math.nan, episode_length=2.0, episodes=3)])
    assert store.lanes.evaluations()["a"].fitness is None
    with sqlite3.connect(store.directory / "run.sqlite") as connection:
        assert connection.execute("SELECT fitness FROM results").fetchall() == [(None,)]
        assert connection.execute("SELECT fitness FROM evaluations").fetchall() == [(None,)]


def test_episodes_that_were_lost_are_kept(store: Store) -> None:
    store.lanes.save_results([result("a"), result("b")])
    scores = [
        Evaluation(lane=lane, fitness=1.0, episode_length=2.0, episodes=3, lost=lost)
        for lane, lost in (("a", 5), ("b", 0))
    ]
    store.lanes.save_evaluations(scores)
    assert store.lanes.evaluations() == {"a": scores[0], "b": scores[1]}


def test_a_generation_comes_back_whole(store: Store) -> None:
    no_program = Verdict(candidate="", code=VerdictCode.NO_PROGRAM, findings=(Finding(rule="r", message="m"),))
    store.rewards.save_verdict(CANDIDATE, ACCEPTED, REPLY)
    store.lanes.save_results([result("a-s0")])
    trained = store.lanes.result("a-s0")
    entries = (
        Scored(
            sample=Sample(generation=0, slot=0, candidate=CANDIDATE, verdict=ACCEPTED), result=trained, feedback="good"
        ),
        Scored(
            sample=Sample(generation=0, slot=1, candidate=None, verdict=no_program, attempts=3),
            result=None,
            feedback="bad",
        ),
    )
    store.save_generation(Generation(0, entries))
    assert store.history().generations == (Generation(0, entries),)


def test_messages_json_shows_each_prompt_once(store: Store) -> None:
    prompt = Prompt(messages=(Message("system", "be brief"), Message("user", "write \ud800")))
    for _ in range(2):  # a resumed run asks again
        store.talk.save_prompt(0, range(0, 2), prompt, None)
    (asked,) = json.loads((store.directory / "messages.json").read_text())
    assert asked["messages"] == [
        {"role": "system", "content": "be brief"},
        {"role": "user", "content": "write ?"},
    ]


def test_what_is_finished_cannot_be_written_again(store: Store) -> None:
    store.talk.save_reply(0, 0, 0, REPLY)
    with pytest.raises(sqlite3.IntegrityError):
        store.talk.save_reply(0, 0, 0, REPLY)
    assert store.talk.replies() == (REPLY,)


# --- opening ---------------------------------------------------------------------------------------------------------


def _open(directory: Path, answer) -> None:
    try:
        Store.open(directory, CONFIG).close()
        answer.put("opened")
    except StoreError as error:
        answer.put(str(error))


def test_a_run_is_refused_to_a_second_process(store: Store) -> None:
    spawn = multiprocessing.get_context("spawn")
    answer = spawn.Queue()
    process = spawn.Process(target=_open, args=(store.directory, answer))
    process.start()
    process.join()
    assert "Another process is working on" in answer.get(timeout=60)


def test_a_run_can_be_viewed_while_it_goes_on_but_not_written(store: Store) -> None:
    with Store.view(store.directory) as view:
        store.talk.save_reply(0, 0, 0, REPLY)
        assert view.talk.replies() == (REPLY,)
        with pytest.raises(StoreError):
            view.talk.save_reply(0, 0, 1, REPLY)


def test_the_same_settings_reopen_a_run_also_on_another_device(tmp_path: Path) -> None:
    Store.open(tmp_path / "run", CONFIG).close()
    elsewhere = dataclasses.replace(CONFIG, device="cuda", threads=4, max_cost=9.0)
    Store.open(tmp_path / "run", elsewhere).close()
    assert read_config(tmp_path / "run") == CONFIG


def test_other_settings_are_refused_by_name(tmp_path: Path) -> None:
    Store.open(tmp_path / "run", CONFIG).close()
    other = dataclasses.replace(CONFIG, env="humanoid", seed=4)
    with pytest.raises(StoreError, match=r"env=humanoid \(was ant\), seed=4 \(was 0\)"):
        Store.open(tmp_path / "run", other)
    Store.open(tmp_path / "run", CONFIG).close()  # the refusal left no lock behind


def test_a_directory_with_other_things_in_it_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(StoreError, match="not empty and not a run"):
        Store.open(tmp_path, CONFIG)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize("read", [Store.view, read_config, read_replies])
def test_a_directory_without_a_run_is_named(tmp_path: Path, read) -> None:
    with pytest.raises(StoreError, match="is not a run"):
        read(tmp_path)


def test_a_run_killed_before_its_schema_is_said_never_to_have_begun(tmp_path: Path) -> None:
    (tmp_path / "run.sqlite").touch()
    with pytest.raises(StoreError, match="never began"):
        read_config(tmp_path)
    assert not has_begun(tmp_path)
    with Store.open(tmp_path, CONFIG) as store:
        assert store.config == CONFIG and has_begun(tmp_path)


def test_a_run_killed_before_its_settings_has_not_begun(tmp_path: Path) -> None:
    assert not has_begun(tmp_path)
    Database(tmp_path, writable=True).close()
    with pytest.raises(StoreError, match="never began"):
        read_config(tmp_path)
    assert not has_begun(tmp_path)


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "run.sqlite").write_bytes(b"not a database " * 1000)
    for read in (lambda: Store.open(tmp_path, CONFIG), lambda: has_begun(tmp_path)):
        with pytest.raises(StoreError, match="damaged or not a run"):
            read()


STORED = json.loads(encode(ACCEPTED))
CHANGED = {
    "cut off": encode(ACCEPTED)[:-20],
    "another type": "[]",
    "nested without end": "[" * 100_000,
    "a code nobody knows": json.dumps(STORED | {"code": "harmless"}),
    "accepted without a graph": json.dumps(STORED | {"graph": None}),
    "a finding with more fields": json.dumps(STORED | {"findings": [{"__class__": "os"}]}),
    "a finding of numbers": json.dumps(STORED | {"findings": [{"rule": 1, "message": 2, "fix": 3, "line": 4}]}),
    "an operation that is no text": json.dumps(
        STORED | {"graph": STORED["graph"] | {"nodes": [{"op": [], "args": []}]}}
    ),
}


@pytest.mark.parametrize("how", CHANGED)
def test_a_row_that_was_changed_is_named_and_nothing_of_it_is_used(store: Store, how: str) -> None:
    store._database.put("verdicts", {"candidate": "x", "source": "", "verdict": CHANGED[how]})
    with pytest.raises(StoreError, match=r"run\.sqlite holds a row that was changed .* restore the file"):
        store.rewards.verdict("x")


def test_a_word_that_no_search_ends_with_is_named(store: Store) -> None:
    store._database.put("ended", {"id": 1, "word": "best of all"})
    with pytest.raises(StoreError, match="was changed"):
        store.glance()


@pytest.mark.parametrize("field", ["state", "fitness", "curves", "env_steps", "best_reward", "message"])
def test_a_result_that_was_changed_is_named(store: Store, field: str) -> None:
    data = json.loads(encode_result(result("a", fitness=1.0))) | {field: ["x"]}
    store._database.put("results", {"lane": "a", "fitness": 1.0, "result": json.dumps(data)})
    with pytest.raises(StoreError, match="was changed"):
        store.lanes.results()


def test_lanes_that_trained_as_one_are_kept_together(store: Store) -> None:
    store.lanes.save_results([result("a-s0")])
    with pytest.raises(sqlite3.IntegrityError):
        store.lanes.save_results([result("b-s0"), result("a-s0")])
    assert set(store.lanes.results()) == {"a-s0"}


def test_what_is_no_run_says_what_is_there(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="is not a run: there is no such directory"):
        Store.view(tmp_path / "absent")
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match="is not a run: it is a file; name the directory that `eureka run` printed"):
        Store.view(tmp_path / "file")
    Store.open(tmp_path / "outputs" / "mine", RunConfig()).close()
    with pytest.raises(StoreError, match="is not a run: it holds runs; name one, such as .*mine"):
        Store.view(tmp_path / "outputs")
