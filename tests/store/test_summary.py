import json
import os
import shutil
from dataclasses import replace

import pytest
from report.scripted import search_in

from openeureka.config import RunConfig
from openeureka.errors import StoreError
from openeureka.store import Store, look
from openeureka.store.db import FILENAME, SUMMARY
from openeureka.testing.scripted import reply


@pytest.fixture
def run(tmp_path):
    return search_in(tmp_path / "run", [reply(1), reply(2)])


@pytest.fixture
def stand(run):
    with Store.view(run) as store:
        return store.config, store.glance()


@pytest.fixture
def no_rows(monkeypatch):
    """Fails a test that opens the database."""
    monkeypatch.setattr(Store, "view", lambda directory: pytest.fail("the rows were asked"))


def test_an_ended_run_is_summed_up(run, stand, no_rows):
    assert look(run) == stand


def test_a_copy_that_kept_its_times_needs_no_rows(run, stand, tmp_path, no_rows):
    shutil.copytree(run, tmp_path / "copy")
    assert look(tmp_path / "copy") == stand


def test_one_of_a_version_that_kept_no_word_is_as_good(run, stand, no_rows):
    told = json.loads((run / SUMMARY).read_text())
    assert told["glance"].pop("word") == "not decided"
    (run / SUMMARY).write_text(json.dumps(told))
    assert look(run) == (stand[0], replace(stand[1], word=""))


def test_a_run_at_work_is_read_itself(run, stand):
    config, glance = stand
    told = json.loads((run / SUMMARY).read_text())
    with Store.open(run, config):
        (run / SUMMARY).write_text(json.dumps(told | {"glance": {**told["glance"], "trainings": 77}}))
        assert look(run) == (config, glance)


def test_rows_that_changed_after_the_summary_count(run, stand):
    os.utime(run / FILENAME, (1, 1))
    told = json.loads((run / SUMMARY).read_text())
    (run / SUMMARY).write_text(json.dumps(told | {"glance": {**told["glance"], "trainings": 77}}))
    assert look(run) == stand


def test_a_run_that_goes_on_is_summed_up_anew(run, stand, no_rows):
    os.utime(run / FILENAME, (1, 1))
    with Store.open(run, stand[0]):
        pass
    assert look(run) == stand


def nonsense(run):
    (run / SUMMARY).write_bytes(b"\xff{")


def of_another_shape(run):
    told = json.loads((run / SUMMARY).read_text())
    (run / SUMMARY).write_text(json.dumps(told | {"glance": []}))


def with_an_unknown_setting(run):
    told = json.loads((run / SUMMARY).read_text())
    (run / SUMMARY).write_text(json.dumps(told | {"config": {**told["config"], "colour": "red"}}))


def with_a_setting_of_another_type(run):
    told = json.loads((run / SUMMARY).read_text())
    (run / SUMMARY).write_text(json.dumps(told | {"config": {**told["config"], "sample": "many"}}))


def a_link(run):
    (run / SUMMARY).rename(run / "elsewhere")
    (run / SUMMARY).symlink_to("elsewhere")


def a_pipe(run):
    (run / SUMMARY).unlink()
    os.mkfifo(run / SUMMARY)


def endless(run):
    with (run / SUMMARY).open("r+b") as file:
        file.truncate(1 << 30)


@pytest.mark.parametrize(
    "spoil",
    [nonsense, of_another_shape, with_an_unknown_setting, with_a_setting_of_another_type, a_link, a_pipe, endless],
)
def test_a_spoiled_summary_is_as_none(run, stand, spoil):
    spoil(run)
    assert look(run) == stand


def test_a_run_is_whole_where_no_summary_can_be_written(tmp_path, monkeypatch):
    def full(*_):
        raise StoreError("The disk is full.")

    monkeypatch.setattr("openeureka.store.summary.artifacts.write", full)
    with Store.open(tmp_path / "run", RunConfig(env="toy")):
        pass
    assert look(tmp_path / "run")[0].env == "toy"
    assert not (tmp_path / "run" / SUMMARY).exists()


def test_where_there_is_no_run_nothing_is_summed_up(tmp_path):
    with pytest.raises(StoreError, match="is not a run"):
        look(tmp_path)
