from tensorboard.backend.event_processing.event_file_loader import EventFileLoader

from openeureka.report import events

CURVES = {"fitness": (None, 2.0, 3.5), "component/upright": (0.5,)}


def test_tensorboard_reads_back_every_defined_value(tmp_path):
    path = tmp_path / events.FILE_NAME
    path.write_bytes(events.encode(CURVES))
    read = [
        (value.tag, event.step, value.tensor.float_val[0])
        for event in EventFileLoader(str(path)).Load()
        for value in event.summary.value
    ]
    assert read == [("fitness", 1, 2.0), ("fitness", 2, 3.5), ("component/upright", 0, 0.5)]


def test_equal_curves_give_equal_files():
    assert events.encode(CURVES) == events.encode(CURVES)
