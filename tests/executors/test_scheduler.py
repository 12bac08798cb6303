"""Which population is next, and what is tried again, with scripted workers: no process, no physics."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import NoReturn

import pytest

from openeureka.errors import StoreError, TaskError, WorkerError
from openeureka.executors import retry
from openeureka.executors.retry import LOSSES, Errand
from openeureka.executors.scheduler import deal, train
from openeureka.executors.transport import Seat, WorkerLost, farewell
from openeureka.training.wire import SNAPSHOT, pack, unpack_lanes
from openeureka.types import (
    LaneSpec,
    Node,
    NodeShare,
    RewardGraph,
    TrainBudget,
    TrainingProgress,
    TrainingResult,
    TrainingState,
)
from openeureka.worker import Frame

DONE = Frame({"done": True})
GRAPH = RewardGraph(nodes=(Node("input", ("pole_angle",)),), reward=0, components=(("angle", 0),))
Said = Iterator[Frame | Exception]
"""What a worker says before it falls silent for ever; an exception is its death."""


class ScriptedCall:
    def __init__(self, device: str, said: Said) -> None:
        self.device, self.said = device, said
        self.coming = next(said, None)
        self.closed = False

    def receive(self) -> Frame:
        found, self.coming = self.coming, next(self.said, None)
        assert found is not None, "`receive` is called on a worker that is silent"
        if isinstance(found, Exception):
            raise found
        return found

    def stop(self) -> None:
        self.coming = Frame({}, {SNAPSHOT: self.device.encode()})
        self.said = iter([DONE])

    def close(self) -> None:
        self.closed = True


class Scripted:
    """A `Transport` whose workers follow a script: a function of the names of their lanes."""

    def __init__(self, script: Callable[[list[str]], Said]) -> None:
        self.script = script
        self.asked: list[tuple[str, list[str]]] = []
        self.calls: list[ScriptedCall] = []

    def call(self, request: Frame, seat: Seat) -> ScriptedCall:
        names = [lane.id for lane in unpack_lanes(request)[1]]
        self.asked.append((seat.device, names))
        self.calls.append(ScriptedCall(seat.device, self.script(names)))
        return self.calls[-1]

    def wait(self, calls: Sequence[ScriptedCall], timeout: float | None = None) -> list[ScriptedCall]:
        ready = [call for call in calls if call.coming is not None]
        assert ready or timeout is not None, "all workers are silent for ever"
        return ready


def result(name: str) -> Frame:
    return pack(
        TrainingResult(lane=name, state=TrainingState.FINISHED, fitness=1.0, curves={}, env_steps=1, seconds=0.0)
    )


def progress(names: Sequence[str]) -> Frame:
    return pack(TrainingProgress(epoch=2, epochs=4, env_steps_per_second=1.0, fitness=dict.fromkeys(names)))


def until(name: str) -> Callable[[list[str]], Said]:
    """A script by which workers give one result after the other, and die at this lane."""

    def script(names: list[str]) -> Said:
        for lane in names:
            if lane == name:
                yield WorkerError("It died.")
                return
            yield result(lane)
        yield DONE

    return script


def errands(*names: str, folder: Path | None = None, generated: bool = False) -> list[Errand]:
    """An errand for each name: `ab` is one with the lanes `a` and `b`."""
    program = GRAPH if generated else "human"
    return [
        Errand("cartpole", [LaneSpec(id=name, program=program) for name in of], TrainBudget(), folder) for of in names
    ]


def trained(transport: Scripted, shares: Sequence[Errand], devices: str = "0") -> list[str]:
    """Lanes in the order of their results, those that failed with a `!`."""
    found = train(transport, shares, [Seat(device, 1) for device in devices])
    results = [message for message in found if isinstance(message, TrainingResult)]
    assert all(call.closed for call in transport.calls)
    return [message.lane + "!" * (message.state is TrainingState.FAILED) for message in results]


def test_lanes_are_dealt_in_order_and_those_of_a_snapshot_stay_together():
    lanes = [LaneSpec(id=name, program="human") for name in "abcdefg"]

    def dealt(kept: Sequence[str], count: int) -> list[str]:
        return ["".join(lane.id for lane in share) for share in deal(lanes, kept, count)]

    assert dealt([], 3) == ["abc", "def", "g"]
    assert dealt(["fb"], 3) == ["fb", "acd", "eg"]
    assert dealt(["ax", ""], 1) == ["a", "bcdefg"]  # x has its result; an empty group is none
    assert dealt(["abcd", "efg"], 1) == ["abcd", "efg"]


def test_a_free_slot_takes_the_next_population():
    transport = Scripted(until("nobody"))
    # In each round, every worker says one thing. The first seat is free in the second round, and again in the fourth.
    assert trained(transport, errands("a", "bcdef", "g", "h"), "01") == ["a", "b", "c", "d", "g", "e", "f", "h"]
    assert [(device, "".join(names)) for device, names in transport.asked] == [
        ("0", "a"), ("1", "bcdef"), ("0", "g"), ("0", "h"),
    ]  # fmt: skip


def test_progress_of_one_population_after_another_counts_on():
    def script(names: list[str]) -> Said:
        yield from (progress(names), *map(result, names), DONE)

    found = train(Scripted(script), errands("a", "b"), [Seat("0", 1)])
    seen = [message for message in found if isinstance(message, TrainingProgress)]
    assert [(m.epoch, m.epochs) for m in seen] == [(1, 4), (3, 4)]  # means of (2, 0) and of (4, 2)


def test_what_ends_a_worker_is_tried_together_once_more_then_alone():
    transport = Scripted(until("x"))
    assert trained(transport, errands("axcd", "e")) == ["a", "c", "d", "x!", "e"]
    assert [names for _, names in transport.asked] == [
        ["a", "x", "c", "d"], ["x", "c", "d"], ["x"], ["c"], ["d"], ["e"],
    ]  # fmt: skip


def test_a_machine_that_leaves_is_no_attempt_of_its_lanes():
    left = iter(range(1, LOSSES + 1))

    def script(names: list[str]) -> Said:
        yield result(names[0])
        if next(left, None) is not None:
            yield WorkerLost("It left.")
            return
        yield from (*map(result, names[1:]), DONE)

    transport = Scripted(script)
    assert trained(transport, errands("abc")) == ["a", "b", "c"]  # each is told once, though a is repeated
    assert [names for _, names in transport.asked] == [["a", "b", "c"]] * (LOSSES + 1)


def test_machines_that_leave_one_after_the_other_count_at_last():
    transport = Scripted(lambda names: iter([WorkerLost("It left.")]))
    assert trained(transport, errands("ab")) == ["a!", "b!"]
    assert len(transport.asked) == LOSSES + 2 + 2  # after LOSSES free ones: two together, each alone


def test_progress_adds_up_over_the_shares_of_a_node():
    def script(names: list[str]) -> Said:
        share = NodeShare(lanes=len(names), env_steps_per_second=10.0)
        part = TrainingProgress(epoch=1, epochs=2, env_steps_per_second=10.0, fitness={}, nodes={names[0][0]: share})
        yield from (pack(part), pack(part), *map(result, names), DONE)

    found = train(Scripted(script), errands("nm", "nop", "x"), [Seat("0", 1), Seat("1", 1), Seat("2", 1)])
    seen = [message.nodes for message in found if isinstance(message, TrainingProgress)]
    assert seen[2] == {
        "n": NodeShare(lanes=5, env_steps_per_second=20.0),
        "x": NodeShare(lanes=1, env_steps_per_second=10.0),
    }


def test_where_no_generated_reward_trains_the_human_one_says_who_is_at_fault():
    rewards = Scripted(lambda names: until("x")(names) if names != ["control"] else until("nobody")(names))
    assert trained(rewards, errands("x", generated=True)) == ["x!"]
    assert [names for _, names in rewards.asked] == [["x"], ["x"], ["x"], ["control"]]
    machine = Scripted(lambda names: iter([WorkerError(f"{names[0]} died.")]))
    with pytest.raises(WorkerError, match="x died"):
        trained(machine, errands("x", generated=True))


class Sick(Scripted):
    """Every worker on device 0 dies."""

    def call(self, request: Frame, seat: Seat) -> ScriptedCall:
        call = super().call(request, seat)
        if seat.device == "0":
            call.coming, call.said = WorkerError("It was killed."), iter([])
        return call


def test_what_died_on_one_device_is_tried_on_another():
    transport = Sick(until("nobody"))
    assert sorted(trained(transport, errands("ab", "cd", "ef", "g"), "01")) == ["a", "b", "c", "d", "e", "f", "g"]
    on_the_sick = [names for device, names in transport.asked if device == "0"]
    assert on_the_sick == [["a", "b"], ["e", "f"], ["g"]]  # each was tried there only once


@pytest.mark.parametrize(("devices", "tried"), [("01", "0101"), ("10", "10101"), ("012", "0121"), ("00", "0000")])
def test_the_machine_is_at_fault_where_the_human_reward_trains_on_no_device(devices: str, tried: str):
    """Where one device is sick, the human reward trains on another one. Deaths that the lane may have caused do not
    count against a device."""
    rewards = Sick(lambda names: until("x")(names) if names != ["control"] else until("nobody")(names))
    if devices == "00":
        with pytest.raises(WorkerError, match="It was killed"):
            trained(rewards, errands("x", generated=True), devices)
    else:
        assert trained(rewards, errands("x", generated=True), devices) == ["x!"]
    assert "".join(device for device, _ in rewards.asked) == tried


def test_what_reported_before_it_died_waits_for_no_other_device():
    """The other device may be at work for hours."""
    left = iter([WorkerError("It was killed.")])

    def script(names: list[str]) -> Said:
        yield progress(names)
        if names == ["a"] and (died := next(left, None)) is not None:
            yield died
            return
        yield from (*(progress(names) for _ in range(9 * (names == ["b"]))), *map(result, names), DONE)

    transport = Scripted(script)
    assert trained(transport, errands("a", "b"), "01") == ["a", "b"]
    assert transport.asked == [("0", ["a"]), ("1", ["b"]), ("0", ["a"])]


def test_what_died_trains_at_no_rate_until_it_is_tried_again():
    def script(names: list[str]) -> Said:
        share = NodeShare(lanes=1, env_steps_per_second=10.0)
        part = TrainingProgress(
            epoch=1, epochs=2, env_steps_per_second=10.0, fitness={}, nodes={f"node-{names[0]}": share}
        )
        yield pack(part)
        yield WorkerError("It died.") if names == ["a"] else pack(part)
        yield from (*map(result, names), DONE)

    found = train(Scripted(script), errands("a", "b"), [Seat("0", 1), Seat("1", 1)])
    seen = [message for message in found if isinstance(message, TrainingProgress)]
    assert [(m.epoch, m.env_steps_per_second, sorted(m.nodes)) for m in seen[:3]] == [
        (0, 10.0, ["node-a"]), (1, 20.0, ["node-a", "node-b"]), (1, 10.0, ["node-b"]),
    ]  # fmt: skip


def test_a_worker_that_leaves_lanes_out_is_asked_again():
    transport = Scripted(lambda names: iter([result(names[0]), DONE]))
    assert trained(transport, errands("abcd")) == ["a", "b", "c", "d"]
    silent = Scripted(lambda names: iter([DONE]))
    assert trained(silent, errands("ab")) == ["a!", "b!"]


def test_a_task_that_fails_stops_all_and_leaves_the_state_of_the_others(tmp_path: Path):
    def script(names: list[str]) -> Said:
        if names == ["a"]:
            yield TaskError("The task is at fault.")

    transport = Scripted(script)
    with pytest.raises(TaskError):
        trained(transport, errands("a", "b", folder=tmp_path / "snapshots"), "01")
    assert all(call.closed for call in transport.calls)
    assert b"1" in [file.read_bytes() for file in (tmp_path / "snapshots").glob("*.pt")]


def test_who_stops_listening_is_left_the_state_of_every_population(tmp_path: Path):
    def script(names: list[str]) -> Said:
        yield progress(names)

    transport = Scripted(script)
    stream = train(transport, errands("a", "b", "c", folder=tmp_path / "snapshots"), [Seat("0", 1), Seat("1", 1)])
    assert isinstance(next(stream), TrainingProgress)
    stream.close()
    assert sorted(file.read_bytes() for file in (tmp_path / "snapshots").glob("*.pt")) == [b"0", b"1"]
    assert [names for _, names in transport.asked] == [["a"], ["b"]] and all(call.closed for call in transport.calls)


def test_a_state_from_which_a_worker_went_on_is_kept_when_it_dies_before_the_next(tmp_path: Path):
    (errand,) = errands("ab", folder=tmp_path / "snapshots")

    def begun(*frames: Frame | Exception) -> bytes | None:
        state = errand.request("cpu").blobs.get(SNAPSHOT)
        call = ScriptedCall("cpu", iter(frames))
        while not errand.hear(call)[1]:
            pass
        return state

    assert begun(Frame({}, {SNAPSHOT: b"of hours"}), WorkerError("It was killed.")) is None
    assert begun(progress("ab"), WorkerError("It was killed.")) == b"of hours"
    assert begun(result("a"), DONE) == begun(WorkerError("It cannot read that.")) == b"of hours"
    assert [lost.lane for lost in errand.failed()] == ["b"] and list(tmp_path.iterdir()) == []


def test_a_state_is_removed_once_two_workers_died_of_it_and_not_before(tmp_path: Path):
    """The first may have died of something else, such as a GPU that another program held. After two deaths the state
    is at fault, not a lane."""
    died = WorkerError("It was killed.")
    said: list[tuple[str, bytes | None, list[Frame | Exception]]] = [
        ("ab", None, [Frame({}, {SNAPSHOT: b"of hours"}), died]),
        ("ab", b"of hours", [died]),
        ("a", b"of hours", [progress("a"), died]),  # it can be read, so it did not cause the last death
        ("b", b"of hours", [died]),
    ]
    again = [*said[:2], ("a", b"of hours", [died]), ("a", None, [result("a"), DONE]), ("b", None, [died])]
    for number, script in enumerate((said, again)):
        (errand,) = errands("ab", folder=tmp_path / str(number))
        for names, state, frames in script:
            request = errand.request("cpu")
            assert ("".join(lane.id for lane in unpack_lanes(request)[1]), request.blobs.get(SNAPSHOT)) == (
                names,
                state,
            )
            call = ScriptedCall("cpu", iter(frames))
            while not errand.hear(call)[1]:
                pass
        assert errand.over and "".join(lost.lane for lost in errand.failed()) == ("ab" if number == 0 else "b")
    assert list(tmp_path.iterdir()) == []


def test_results_that_were_under_way_at_ctrl_c_are_told(tmp_path: Path):
    class Interrupted(Scripted):
        def call(self, request: Frame, seat: Seat) -> ScriptedCall:
            call = super().call(request, seat)
            call.stop = lambda: None  # its training is over, so it has no snapshot to send
            return call

        def wait(self, calls: Sequence[ScriptedCall], timeout: float | None = None) -> list[ScriptedCall]:
            if timeout is None:
                raise KeyboardInterrupt
            return super().wait(calls, timeout)

    found: list[TrainingResult | TrainingProgress] = []
    transport = Interrupted(lambda names: iter([Frame({}, {SNAPSHOT: b"state"}), result("a"), DONE]))
    with pytest.raises(KeyboardInterrupt):
        for message in train(transport, errands("a", folder=tmp_path / "snapshots"), [Seat("0", 1)]):
            found.append(message)
    assert [message.lane for message in found if isinstance(message, TrainingResult)] == ["a"]
    assert transport.calls[0].closed and list(tmp_path.iterdir()) == []


def test_a_full_disk_costs_a_snapshot_and_no_training(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(*_: object) -> NoReturn:
        raise StoreError("The disk is full.")

    monkeypatch.setattr("openeureka.executors.snapshots.artifacts.write", full)
    state = Frame({}, {SNAPSHOT: b"state"})
    transport = Scripted(lambda names: iter([progress(names), state, *map(result, names), DONE]))
    assert trained(transport, errands("a", "bc", folder=tmp_path / "snapshots")) == ["a", "b", "c"]

    def failing(names: list[str]) -> Said:
        yield TaskError("The task is at fault.") if names == ["a"] else state

    with pytest.raises(TaskError):  # not a StoreError, though the disk is full for the last snapshots
        trained(Scripted(failing), errands("a", "b", folder=tmp_path / "snapshots"), "01")
    transport = Scripted(lambda names: iter([progress(names)]))
    stream = train(transport, errands("a", folder=tmp_path / "snapshots"), [Seat("0", 1)])
    next(stream)
    stream.close()
    assert all(call.closed for call in transport.calls)


def test_a_worker_that_dies_further_than_the_ones_before_costs_no_attempt(tmp_path: Path):
    """In days of training, a worker may be killed more than once through no fault of its lanes."""

    def at(epoch: int) -> Frame:
        return pack(TrainingProgress(epoch=epoch, epochs=900, env_steps_per_second=1.0, fitness={"a": None, "b": None}))

    def state() -> Frame:
        return Frame({}, {SNAPSHOT: b"state"})

    died = WorkerError("It was killed.")
    said: list[list[Frame | Exception]] = [
        [at(100), state(), at(150), died],  # the first of two attempts together
        [at(101), at(200), state(), at(201), died],  # left a state from beyond 150: not counted
        [at(300), state(), died],  # from beyond 201: not counted
        [at(301), died],  # beyond 300, but left no state from there: the second attempt
        [at(301), died],  # a alone
    ]
    (errand,) = errands("ab", folder=tmp_path / "snapshots")
    asked: list[list[str]] = []
    for frames in said:
        asked.append([lane.id for lane in unpack_lanes(errand.request("cpu"))[1]])
        call = ScriptedCall("cpu", iter(frames))
        while not errand.hear(call)[1]:
            pass
    assert asked == [["a", "b"]] * 4 + [["a"]]
    again: list[list[Frame | Exception]] = [[at(250), state(), at(299), died], [at(300), died]]
    (errand,) = errands("ab", folder=tmp_path / "other")  # a lane that kills its worker at the same place each time
    for frames in again:
        errand.request("cpu")
        call = ScriptedCall("cpu", iter(frames))
        while not errand.hear(call)[1]:
            pass
    assert [lane.id for lane in unpack_lanes(errand.request("cpu"))[1]] == ["a"]


def test_a_worker_may_end_its_epoch_before_it_leaves_its_state(monkeypatch: pytest.MonkeyPatch):
    (errand,) = errands("a")
    errand.request("cpu")
    call = ScriptedCall("cpu", (progress("a") for _ in range(4)))
    allowed = [errand.farewell]
    for now in (100.0, 101.0, 121.0, 221.0):  # epochs of 1, 20 and 100 seconds
        monkeypatch.setattr(retry, "time", SimpleNamespace(monotonic=lambda now=now: now))
        errand.hear(call)
        allowed.append(errand.farewell)
    assert allowed == [10.0, 10.0, 10.0, 40.0, 100.0]


def test_who_is_silent_for_longer_than_its_time_is_left_behind():
    class Polled(Scripted):
        def wait(self, calls: Sequence[ScriptedCall], timeout: float | None = None) -> list[ScriptedCall]:
            if calls == self.calls[1:] and not said:  # the first call has run out of time
                said.append(ScriptedCall.stop(calls[0]))
            return [call for call in calls if call.coming is not None]

    said: list[None] = []
    transport = Polled(lambda names: iter([]))
    for errand in errands("a", "b"):
        transport.call(errand.request("cpu"), Seat(errand.lanes[0].id, 1)).stop = lambda: None
    first, second = transport.calls
    assert [call.device for call, _ in farewell(transport, {first: 0.05, second: 60.0})] == ["b", "b"]


def test_lanes_that_are_tried_one_by_one_go_on_from_the_state_of_all(tmp_path: Path):
    """Their common state stays until the last of them has begun. At the end no file is left."""
    folder = tmp_path / "snapshots"
    (errand,) = errands("abc", folder=folder)
    state = [b"of all", b"of all, later", b"of a alone"]
    said: list[list[Frame | Exception]] = [
        [Frame({}, {SNAPSHOT: state[0]}), WorkerError("It died.")],
        [Frame({}, {SNAPSHOT: state[1]}), WorkerError("It died again.")],
        [Frame({}, {SNAPSHOT: state[2]}), WorkerError("It died for a.")],
        [result("b"), DONE],
        [result("c"), DONE],
    ]
    begun: list[bytes | None] = []
    for frames in said:
        begun.append(errand.request("cpu").blobs.get(SNAPSHOT))
        call = ScriptedCall("cpu", iter(frames))
        while not errand.hear(call)[1]:
            pass
    assert begun == [None, state[0], state[1], state[1], state[1]]
    assert [lost.lane for lost in errand.failed()] == ["a"] and list(tmp_path.iterdir()) == []
