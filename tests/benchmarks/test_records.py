"""What files of results hold: lanes of several runs, and where they were measured."""

from typing import Any

import lanes
import pytest
import records

from openeureka.config import RunConfig

CONFIG = RunConfig(env="ant", model="claude", steps=1000, worlds=8)


def test_lanes_of_several_runs_stand_together_and_each_run_says_what_it_was():
    one = lanes.joined({"steps": 1000}, "lanes", {"a-s0": 1.0}, CONFIG, "one")
    both = lanes.joined(one, "lanes", {"b-s0": 2.0}, CONFIG, "two")
    assert both["steps"] == 1000 and both["lanes"] == {"a-s0": 1.0, "b-s0": 2.0}
    told = both["runs"]["two"]
    assert both["runs"]["one"] == one["runs"]["one"] and told["lanes"] == ["b-s0"]
    assert (told["model"], told["worlds"]) == ("claude", 8) and told["device"] and told["versions"]["mujoco"]


def test_a_lane_of_another_run_is_not_replaced_and_that_of_the_same_run_is():
    known = lanes.joined({}, "lanes", {"human-s0": 1.0}, CONFIG, "one")
    with pytest.raises(SystemExit, match="two has another human-s0"):
        lanes.joined(known, "lanes", {"human-s0": 2.0}, CONFIG, "two")
    assert lanes.joined(known, "lanes", {"human-s0": 1.0}, CONFIG, "two")["lanes"] == {"human-s0": 1.0}
    assert lanes.joined(known, "lanes", {"human-s0": 2.0}, CONFIG, "one")["lanes"] == {"human-s0": 2.0}


@pytest.mark.parametrize("name, key", [("noise", "played"), ("predictors", "lanes")])
def test_every_lane_of_the_files_is_in_a_run(name: str, key: str):
    for entry in records.read(records.results(name)).values():
        assert {lane for run in entry["runs"].values() for lane in run["lanes"]} == set(entry[key])


def test_a_package_that_is_not_installed_has_no_version():
    found: dict[str, Any] = records.conditions("openeureka-of-tomorrow")
    assert found["versions"]["openeureka-of-tomorrow"] is None and found["versions"]["torch"]
    assert found["machine"]["cores"] and found["machine"]["processor"] and found["date"]
