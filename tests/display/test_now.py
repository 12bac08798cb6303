import pytest

from openeureka.config import RunConfig
from openeureka.display import now
from openeureka.events import Asked, Began, Replied
from openeureka.store.db import NOW
from openeureka.types import NodeShare, Reply, TrainingProgress, Usage

CONFIG = RunConfig(env="cartpole", sample=2, iteration=2)


def told(epoch: int, **fitness: float | None) -> TrainingProgress:
    return TrainingProgress(
        epoch=epoch,
        epochs=1000,
        env_steps_per_second=5.0,
        fitness=fitness,
        latest={lane: {"fitness": value, "component/up": 2.0} for lane, value in fitness.items()},
        nodes={"here": NodeShare(lanes=len(fitness), env_steps_per_second=5.0)},
    )


@pytest.fixture
def recorder(tmp_path, monkeypatch):
    monkeypatch.setattr(now, "PAUSE", 0.0)
    return now.Recorder(tmp_path, CONFIG, Usage())


def test_what_is_written_is_read_back(recorder, tmp_path):
    recorder(Began("sample", 0))
    recorder(Asked((0, 1)))
    recorder(Replied(1, Reply(text="x", model="m", usage=Usage(prompt_tokens=100, completion_tokens=10))))
    found = now.read(tmp_path)
    assert found is not None
    assert (found.doing, found.writing, found.usage.prompt_tokens) == ("asking the model", 1, 100)


def test_every_lane_has_a_value_at_each_place_whenever_it_began(recorder, tmp_path):
    recorder(Began("train", 0))
    recorder(told(1, a=0.5))
    recorder(told(2, a=0.75, b=None))
    found = now.read(tmp_path)
    assert found is not None
    assert (found.epoch, found.epochs, found.at_epochs) == (2, 1000, (1, 2))
    assert found.curves["a"] == {"fitness": (0.5, 0.75), "component/up": (2.0, 2.0)}
    assert found.curves["b"] == {"fitness": (None, None), "component/up": (None, 2.0)}
    recorder(Began("play", 0))
    found = now.read(tmp_path)
    assert found is not None and not found.curves


def test_a_long_training_keeps_few_values_over_its_whole_length(recorder, tmp_path):
    recorder(Began("train", 0))
    for epoch in range(1000):
        recorder(told(epoch, a=float(epoch)))
    found = now.read(tmp_path)
    assert found is not None
    assert now.MOST / 2 <= len(found.at_epochs) <= now.MOST
    assert found.curves["a"]["fitness"] == tuple(map(float, found.at_epochs))
    assert found.at_epochs[0] == 0 and found.at_epochs[-1] > 950
    gaps = [after - before for before, after in zip(found.at_epochs, found.at_epochs[1:], strict=False)]
    assert max(gaps) <= 4 * min(gaps)


def test_lanes_of_the_next_round_take_the_place_of_those_before(recorder, tmp_path):
    recorder(Began("final"))
    for epoch in range(100):
        recorder(told(epoch, first=1.0))
    recorder(told(0, second=2.0))
    found = now.read(tmp_path)
    assert found is not None
    assert (found.at_epochs, set(found.curves)) == ((0,), {"second"})


@pytest.mark.parametrize(
    "text", ["", "{", "[]", '{"doing": 1}', '{"doing": "x", "seconds": 1, "left": 0, "epoch": -1}']
)
def test_what_is_no_such_file_says_nothing(tmp_path, text):
    (tmp_path / NOW).write_text(text)
    assert now.read(tmp_path) is None


def test_a_link_is_not_followed(tmp_path):
    (tmp_path / "elsewhere").write_text("{}")
    (tmp_path / NOW).symlink_to(tmp_path / "elsewhere")
    assert now.read(tmp_path) is None
