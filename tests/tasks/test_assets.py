from __future__ import annotations

import sys

import mujoco
import pytest

from openeureka.errors import TaskError
from openeureka.suite.assets import wheel_file

HAND = ("gymnasium_robotics", "envs/assets/hand/reach.xml")


def test_a_model_of_an_installed_wheel_is_found_and_compiles_without_importing_the_package():
    model = mujoco.MjSpec.from_file(str(wheel_file(*HAND))).compile()
    assert (model.nq, model.nu) == (24, 20)
    assert "gymnasium_robotics" not in sys.modules


@pytest.mark.parametrize("package, path", [("no_such_package", "hand.xml"), ("gymnasium_robotics", "envs/none.xml")])
def test_a_missing_model_names_the_package_to_install(package: str, path: str):
    with pytest.raises(TaskError, match=f"pip install {package.replace('_', '-')}"):
        wheel_file(package, path)
