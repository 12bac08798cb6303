"""What an environment's documentation becomes: the task's intent, the use of each variable, and text in the prompt."""

from __future__ import annotations

import logging

import pytest

from openeureka.adapters.gym import documents
from openeureka.method import prompts
from openeureka.tasks.context import context
from openeureka.types import PromptPlan

from . import worlds  # noqa: F401  registers its environments

DOCUMENT = """
    ## Description
    The goal is to run forward (right) as fast as possible, with a positive reward for the distance, and to last.

    ## Observation Space
    ```{figure} pictures/robot.png
    :name: robot
    ```

    The elements are as follows:

    | Num | Observation     | Min  | Max | Unit         |
    | --- | --------------- | ---- | --- | ------------ |
    | 0   | height of torso | -Inf | Inf | position (m) |
    | 1   | angle of torso  | -Inf | Inf | angle (rad)  |
"""


def test_a_goal_ends_where_it_speaks_of_what_counts():
    assert documents.intent(DOCUMENT, "Run-v1") == "to run forward (right) as fast as possible"
    assert "cheetah run forward (right) as fast as possible" in context("gym:HalfCheetah-v5").description
    assert documents.intent("## Description\nThe goal is to get a high score, fast.", "X-v1").startswith(
        "to do in X-v1"
    )
    assert documents.intent("", "LunarLander-v3") == "to land gently on the landing pad"


def test_that_nobody_says_a_goal_is_said(caplog: pytest.LogCaptureFixture):
    env = "gym:Openeureka/Cells-v0"
    with caplog.at_level(logging.WARNING):
        context(f"{env}+description=to wait")
        assert not caplog.records
        context(env)
    assert [record.message for record in caplog.records] == [
        f"The documentation of {env} states no goal: add +description='to ...' to env={env}"
    ]


@pytest.mark.parametrize(
    ("words", "use"),
    [
        ("z_coordinate_of_torso z-coordinate of the torso (height of hopper) [m]", "directional"),
        ("x_cos_theta x = cos(theta)", "directional"),
        ("sine_of_angle_of_first_arm sine of the angle of the first arm", "directional"),
        ("x_position x position, as `info` has it", "directional"),
        ("distance_from_origin", "directional"),
        ("x_coordinate_of_object_to_be_moved x-coordinate of the object to be moved", "directional"),
        ("left_leg_contact left leg contact", "directional"),
        ("angular_velocity_of_angle_of_torso angular velocity of the angle of the torso", "directional"),
        ("single_angle Single Angle", "zero_centred"),
        ("x_value x-value of position_fingertip - position_target", "zero_centred"),
        ("to_target vector to the target", "zero_centred"),
        ("last_action", "zero_centred"),
    ],
)
def test_only_angles_actions_and_gaps_are_good_near_zero(words: str, use: str):
    assert documents.use_of(words) == use


def test_a_heading_may_be_indented_by_three_spaces_as_in_markdown():
    text = "On ice.\nCold.\n   ## Description\n   The goal is to cross.\n    # 1. code"
    assert documents.sections(text) == {"on ice.": "Cold.", "description": "The goal is to cross.\n    # 1. code"}
    assert "Move left" in context("gym:FrozenLake-v1").source  # each of its headings has a space before it


def test_figures_padding_and_tables_that_repeat_are_left_out():
    known = {"height_of_torso", "angle_of_torso"}
    heading = "## Observation space\n\nThe elements are as follows:\n\n"
    assert documents.told(DOCUMENT, known) == f"{heading}(The state table has them.)"
    table = (
        "| Num | Observation | Min | Max | Unit |\n| --- | --- | --- | --- | --- |\n"
        "| 0 | height of torso | {} | Inf | position (m) |\n| 1 | angle of torso | -Inf | Inf | angle (rad) |"
    )
    assert documents.told(DOCUMENT, {"height_of_torso"}) == heading + table.format("-Inf")
    bounded = DOCUMENT.replace("torso | -Inf", "torso | 0.7 ", 1)  # the state table has no bounds
    assert documents.told(bounded, known) == heading + table.format("0.7")


def test_what_ends_an_episode_early_is_told_and_how_long_one_may_be_is_not():
    told = context("gym:Hopper-v5").source.partition("## Termination\n\n")[2]
    assert "the environment terminates when the Hopper is unhealthy" in told and "$[-0.2, 0.2]$" in told
    assert "1000 timesteps" not in told
    assert context("gym:CartPole-v1").source.endswith("display)")  # left out: "3. Truncation: Episode length ..."
    paid = "## Episode end\nIt falls.\n\nIt is solved with a reward of 1.\n\n- Truncation: soon.\n1. Not."
    assert documents.told(paid) == "## Episode end\n\nIt falls."


def test_a_prompt_calls_documentation_what_it_is():
    asked = prompts.render(context("gym:HalfCheetah-v5"), PromptPlan(count=1), "free").messages[1].content
    assert "From the environment's documentation:\n\n## Action space" in asked
    assert "```" not in asked and "the environment's source" not in asked
