from dataclasses import replace

from tensorboard.backend.event_processing.event_file_loader import EventFileLoader

from openeureka.report import tensorboard
from openeureka.types import TrainingResult, TrainingState

CURVES = {"fitness": (None, 2.0, 3.5), "component/upright": (0.5,)}
UNCOUNTED = TrainingResult(
    lane="a", state=TrainingState.FINISHED, fitness=3.5, curves=CURVES, env_steps=0, seconds=60.0
)


def test_tensorboard_reads_back_every_defined_value(tmp_path):
    path = tmp_path / tensorboard.EVENTS
    path.write_bytes(tensorboard.events_of(UNCOUNTED))
    read = [
        (value.tag, event.step, value.tensor.float_val[0])
        for event in EventFileLoader(str(path)).Load()
        for value in event.summary.value
    ]
    assert read == [("fitness", 1, 2.0), ("fitness", 2, 3.5), ("component/upright", 0, 0.5)]


def test_equal_trainings_give_equal_files():
    assert tensorboard.events_of(UNCOUNTED) == tensorboard.events_of(replace(UNCOUNTED))


def test_the_axes_are_environment_steps_and_seconds(tmp_path):
    result = replace(UNCOUNTED, env_steps=3000)
    path = tmp_path / tensorboard.EVENTS
    path.write_bytes(tensorboard.events_of(result))
    found = [(e.step, e.wall_time) for e in EventFileLoader(str(path)).Load() if e.summary.value]
    # three epochs of 1000 steps and 20 s each; F is not defined in the first, the component only there
    assert found == [(2000, 40.0), (3000, 60.0), (1000, 20.0)]


def test_the_curves_of_a_curriculum_begin_where_its_earlier_stages_end(tmp_path):
    result = TrainingResult(
        lane="a", state=TrainingState.FINISHED, fitness=2.0, curves={"fitness": (1.0, 2.0)}, env_steps=50,
        steps_before=30, seconds=10.0,
    )  # fmt: skip
    path = tmp_path / tensorboard.EVENTS
    path.write_bytes(tensorboard.events_of(result))
    assert [event.step for event in EventFileLoader(str(path)).Load() if event.summary.value] == [40, 50]


def test_a_number_of_the_whole_training_is_no_curve(tmp_path):
    curves = {"fitness": (1.0, 2.0), "component_early/x": (0.5,), "component_late/x": (0.25,)}
    result = TrainingResult(
        lane="a", state=TrainingState.FINISHED, fitness=2.0, curves=curves, env_steps=20, seconds=10.0
    )
    path = tmp_path / tensorboard.EVENTS
    path.write_bytes(tensorboard.events_of(result))
    assert [v.tag for e in EventFileLoader(str(path)).Load() for v in e.summary.value] == ["fitness", "fitness"]


def test_an_epoch_has_the_time_at_which_it_was_done_and_ppo_a_place_of_its_own(tmp_path):
    curves = {"fitness": (None, 2.0), "ppo/kl": (0.5, 0.25)}
    result = TrainingResult(
        lane="a", state=TrainingState.FINISHED, fitness=2.0, curves=curves, env_steps=20, seconds=10.0, clock=(8.0, 9.5)
    )
    path = tmp_path / tensorboard.EVENTS
    path.write_bytes(tensorboard.events_of(result))
    found = [(v.tag, e.wall_time) for e in EventFileLoader(str(path)).Load() for v in e.summary.value]
    assert found == [("fitness", 9.5), ("ppo/kl", 8.0), ("ppo/kl", 9.5)]
