"""F of a drafted task follows from a person's sentence and the names in the model alone."""

import mujoco
import pytest

from openeureka.drafting.aim import find_aim
from openeureka.drafting.source import identifier
from openeureka.drafting.survey import Survey
from openeureka.drafting.table import StateTable
from openeureka.errors import TaskError

# An arm, two cubes, of which the blue one slides along x, and a goal on a mocap body.
TABLE = """
<mujoco>
  <worldbody>
    <geom name="table" type="plane" size="2 2 0.1"/>
    <body name="upper_arm" pos="0 0 0.3">
      <joint name="turn" axis="0 0 1"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/>
      <body name="forearm" pos="0.3 0 0">
        <joint name="bend" axis="0 1 0" range="0 120"/>
        <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/>
        <site name="fingertip" pos="0.3 0 0"/>
      </body>
    </body>
    <body name="red_cube" pos="0.4 0.2 0.03"><freejoint/><geom type="box" size="0.03 0.03 0.03"/></body>
    <body name="blue_cube" pos="0.4 -0.4 0.03">
      <joint name="blue_x" type="slide" axis="1 0 0"/><geom type="box" size="0.03 0.03 0.03"/>
    </body>
    <body name="green_goal" mocap="true" pos="0.4 -0.2 0.03">
      <geom type="sphere" size="0.03" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <actuator><motor joint="turn"/><motor joint="bend"/></actuator>
</mujoco>
"""

WALKER = """
<mujoco>
  <worldbody>
    <geom type="plane" size="2 2 0.1"/>
    <body name="torso" pos="0 0 1"><freejoint/><geom size="0.1"/>
      <body name="leg"><joint name="hip"/><geom type="capsule" fromto="0 0 0 0 0 -0.8" size="0.05"/></body>
    </body>
    <site name="target" pos="3 0 1"/>
  </worldbody>
  <actuator><motor joint="hip"/></actuator>
</mujoco>
"""


def survey(text: str) -> Survey:
    return Survey(mujoco.MjModel.from_xml_string(text))


@pytest.mark.parametrize(
    ("intent", "measure"),
    [
        # The red cube starts 0.4 m from the goal. Within a fifth of that it counts as there.
        ("to push the red cube onto the green goal", "the share of time that red_cube is within 0.08 m of green_goal"),
        ("Sliding the blue cube to the target", "the share of time that blue_cube is within 0.052 m of green_goal"),
        # The elbow starts 0.05 rad off its limit, so the fingertip is sqrt(0.2^2 + 0.2^2 + 0.255^2) = 0.38 m away.
        ("to reach the goal", "the share of time that fingertip is within 0.076 m of green_goal"),
        (
            "make the arm reach the goal with the forearm",
            "the share of time that forearm is within 0.067 m of green_goal",
        ),
        ("move to the target", "the share of time that fingertip is within 0.076 m of green_goal"),
    ],
)
def test_f_is_what_a_sentence_says(intent: str, measure: str):
    aim = find_aim(survey(TABLE), intent)
    assert (aim.measure, aim.missing) == (measure, "")


@pytest.mark.parametrize(
    ("intent", "why"),
    [
        ("to push the red ball onto the green goal", '"ball"'),
        ("to push the cube onto the goal", "the sentence may mean red_cube or blue_cube"),
        ("to lift the red cube", '"lift"'),
        ("to stack the red cube on the blue cube", '"stack"'),
        ("to push the red cube to the goal and back", '"back"'),
        ("to push the red cube away from the goal", '"away"'),
        ("to push the red cube into the drawer", '"drawer"'),
        ("not to push the red cube to the goal", '"not"'),
        ("to push the red cube", "does not say what to bring where"),
        ("to run forward", "no joint without an actuator lets the robot move along x"),
        ("den Würfel zum Ziel schieben", '"den", "würfel", "zum", "ziel", "schieben"'),
        ("to wave leftHand", '"wave"'),
        ("to put the red cube on the table", "table is a plane or a height field, not a single place for red_cube"),
    ],
)
def test_a_sentence_that_is_not_understood_to_its_last_word_gets_no_f(intent: str, why: str):
    aim = find_aim(survey(TABLE), intent)
    assert aim.measure == "" and why in aim.missing


@pytest.mark.parametrize(
    ("intent", "measure"),
    [
        (
            "to make the walker run forward as fast as possible, without falling",
            "the mean speed of torso along x [m/s]",
        ),
        ("to walk to the target", "the share of time that torso is within 0.6 m of target"),
        ("to run backwards", ""),
        ("to walk slowly", ""),
        ("to walk at 1 m/s", ""),
        ("to stand still", ""),
        ("to fall forward", ""),
    ],
)
def test_a_robot_that_goes_runs_or_goes_to_its_goal(intent: str, measure: str):
    assert find_aim(survey(WALKER), intent, names=["walker"]).measure == measure


def test_a_cart_that_a_motor_drives_along_x_does_not_run():
    cart = WALKER.replace("<freejoint/>", '<joint name="rail" type="slide" axis="1 0 0"/>')
    driven = cart.replace('<motor joint="hip"/>', '<motor joint="hip"/><motor joint="rail"/>')
    assert find_aim(survey(cart), "to run forward").measure == "the mean speed of torso along x [m/s]"
    assert "so it counts as fixed" in find_aim(survey(driven), "to run forward").missing


def test_names_may_have_letters_beyond_those_of_english():
    table = survey(TABLE.replace("red_cube", "großer_Würfel"))
    by_words, by_name = find_aim(table, "to push the großer Würfel to the goal"), find_aim(table, thing="großer_Würfel")
    assert by_words == by_name and by_name.mover is not None and by_name.mover.name == "großer_Würfel"
    assert StateTable(table).variable(by_name.mover) == "gro_er_Wurfel_pos"  # names in a reward program are ASCII
    assert [identifier(name) for name in ("目标", "目标b", "2nd")] == ["part", "b", "_2nd"]


def test_the_name_of_a_file_says_nothing_about_what_lies_in_the_model():
    aim = find_aim(survey(TABLE), "to push the red cube to the goal", names=["push_cube"])
    assert aim.mover is not None and aim.mover.name == "red_cube"


def test_without_a_sentence_an_object_shall_be_brought_to_the_goal():
    aim = find_aim(survey(TABLE))
    assert aim.measure == "the share of time that red_cube is within 0.08 m of green_goal"
    assert aim.description == "to bring red_cube to green_goal" and aim.hand is not None
    renamed = find_aim(survey(TABLE.replace("green_goal", "goal_of_blue_cube")))
    assert renamed.mover is not None and renamed.mover.name == "blue_cube"


def test_without_a_sentence_a_robot_that_goes_shall_go_to_its_goal_or_run():
    assert find_aim(survey(WALKER)).measure == "the share of time that torso is within 0.6 m of target"
    assert "mean speed" in find_aim(survey(WALKER.replace('"target"', '"post"'))).measure


def test_a_person_may_name_what_shall_be_where():
    aim = find_aim(survey(TABLE), "to tidy up", thing="blue_cube", goal="red_cube")
    assert aim.mover is not None and aim.goal is not None
    assert (aim.mover.name, aim.goal.name) == ("blue_cube", "red_cube")
    assert find_aim(survey(TABLE), thing="blue_cube").measure.endswith("of green_goal")


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        ({"thing": "red_cub"}, "no body, site or geom `red_cub`. Did you mean `red_cube`"),
        ({"thing": "arrow"}, "no body, site or geom `arrow`. It has upper_arm, forearm, red_cube, blue_cube, green"),
        ({"thing": "table"}, "`table` is fixed to the world"),
        ({"thing": "green_goal"}, "`green_goal` is fixed to the world or mocap"),
        ({"thing": "red_cube", "goal": "red_cube"}, "`red_cube` moves with `red_cube`"),
        ({"thing": "forearm", "goal": "fingertip"}, "`fingertip` moves with `forearm`, so F would be constant"),
        ({"thing": "red_cube", "goal": "table"}, "`table` is a plane or a height field; name a single place on it"),
        ({"thing": "red_cube", "goal": "shelf"}, "no body, site or geom `shelf`"),
    ],
)
def test_a_name_that_is_not_there_is_refused(words: dict[str, str], problem: str):
    with pytest.raises(TaskError, match=problem):
        find_aim(survey(TABLE), **words)


def test_a_plane_that_is_called_a_goal_is_none():
    assert find_aim(survey(TABLE.replace("green_goal", "lamp").replace('"table"', '"goal"'))).point


def test_a_goal_on_slides_is_where_to_and_not_what():
    sliding = TABLE.replace("red_cube", "lamp").replace("blue_cube", "target_cube").replace("green_goal", "post")
    sliding = sliding.replace(
        '<body name="lamp" pos="0.4 0.2 0.03"><freejoint/>', '<body name="lamp" pos="0.4 0.2 0.03">'
    )
    aim = find_aim(survey(sliding))
    assert aim.measure == "the share of time that fingertip is within 0.103 m of target_cube"


LOOP = """
<mujoco>
  <worldbody>
    <body name="arm"><joint name="turn" axis="0 0 1"/><geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02"/>
      <body name="hand" pos="0.3 0 0"><joint name="bend" axis="0 0 1"/>
        <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02"/><site name="tip" pos="0.3 0 0"/></body></body>
    <body name="rod" pos="0.6 0.3 0"><joint axis="0 0 1"/><geom type="capsule" fromto="0 0 0 0 -0.3 0" size="0.02"/>
      <site name="end" pos="0 -0.3 0"/></body>
    <body name="grip" pos="0 0 1" mocap="true"/>
  </worldbody>
  <equality>{}</equality>
  <actuator><motor joint="turn"/><motor joint="bend"/></actuator>
</mujoco>
"""


@pytest.mark.parametrize(
    "equality",
    [
        '<connect body1="hand" body2="rod" anchor="0.3 0 0"/>',
        '<connect site1="tip" site2="end"/>',
        '<weld body1="hand" body2="grip"/>',
    ],
)
def test_no_point_is_made_up_for_what_a_loop_holds(equality: str):
    assert find_aim(survey(LOOP.format(equality))).missing == (
        "an equality constraint couples the joints that carry tip, so its reach is unknown"
    )
    assert find_aim(survey(LOOP.format(equality.replace("/>", ' active="false"/>')))).point


def test_a_hand_that_a_mocap_body_holds_is_said_not_to_move():
    held = LOOP.format('<weld body1="grip" body2="hand"/>').replace(
        "</worldbody>", '<site name="goal" pos="0.5 0.2 0"/></worldbody>'
    )
    doubt = find_aim(survey(held), "to reach the goal").doubt
    assert doubt.startswith("hand is tied to the mocap body grip, which actions do not move: delete that equality, or")
    assert find_aim(survey(held.replace('body2="hand"/>', 'body2="rod"/>')), "to reach the goal").doubt == ""


def test_a_goal_that_is_reached_already_is_said_before_what_else_is_in_the_way():
    looped = LOOP.format('<connect site1="tip" site2="end"/>').replace(
        "</worldbody>", '<site name="goal" pos="0.6 0 0"/></worldbody>'
    )
    missing = find_aim(survey(looped)).missing
    assert missing.startswith(
        "tip is at goal from the start: move one of them, in the model or in `reset`; besides, an "
    )


def test_a_joint_that_follows_another_is_where_that_brings_it():
    # The hand turns back as far as the arm turns, so it keeps its direction. Its tip moves on a circle about (0.3, 0).
    held = survey(LOOP.format('<joint joint1="bend" joint2="turn" polycoef="0 -1 0 0 0"/>'))
    tip = next(place for place in held.places() if place.name == "tip")
    radii = ((held.reach(tip, 20) - [0.3, 0.0, 0.0]) ** 2).sum(1) ** 0.5
    assert radii.tolist() == pytest.approx([0.3] * 20)


def test_a_goal_is_doubted_that_is_reached_already_or_out_of_reach():
    there = TABLE.replace('mocap="true" pos="0.4 -0.2 0.03"', 'mocap="true" pos="0.4 0.2 0.03"')
    assert "from the start: move one of them" in find_aim(survey(there), "to push the red cube to the goal").doubt
    far = TABLE.replace('mocap="true" pos="0.4 -0.2 0.03"', 'pos="9 0 0"')
    assert "is the goal within reach?" in find_aim(survey(far), "to reach the goal").doubt
    assert "is the goal within reach?" in find_aim(survey(TABLE.replace("0.4 -0.2", "9 0")), "to reach the goal").doubt
    assert find_aim(survey(TABLE), "to reach the goal").doubt == ""


def test_without_a_goal_that_is_elsewhere_a_point_is_made_up_and_said_to_be():
    for text, why in (
        (TABLE.replace("green_goal", "lamp"), "The model has no goal"),
        (TABLE.replace("0.4 -0.2 0.03", "0.4 0.2 0.03"), "No goal of the model is usable"),
    ):
        aim = find_aim(survey(text))
        assert aim.point and "a point within its reach" in aim.measure
        assert aim.doubt == f"{why}, so the point is made up."


def test_a_robot_without_a_floor_is_said_to_fall():
    bare = WALKER.replace('<geom type="plane" size="2 2 0.1"/>', "").replace('"target"', '"post"')
    assert "the model has no floor" in find_aim(survey(bare)).doubt
    assert find_aim(survey(WALKER.replace('"target"', '"post"'))).doubt == ""


def test_a_robot_that_falls_through_its_floor_is_said_to_fall():
    ghost = WALKER.replace('"target"', '"post"').replace(
        '<geom size="0.1"/>', '<geom size="0.1" contype="2" conaffinity="0"/>'
    )
    ghost = ghost.replace('size="0.05"/>', 'size="0.05" contype="0" conaffinity="0"/>')
    assert "no part of the robot collides with the floor" in find_aim(survey(ghost)).doubt
    assert find_aim(survey(ghost.replace('contype="2"', 'contype="1"'))).doubt == ""


def test_what_hangs_on_a_driven_string_is_driven():
    pulled = TABLE.replace('<motor joint="bend"/>', '<motor tendon="string"/>').replace(
        "<actuator>",
        '<tendon><spatial name="string"><site site="peg"/><site site="fingertip"/></spatial></tendon><actuator>',
    )
    pulled = pulled.replace('<motor joint="turn"/>', "").replace("<worldbody>", '<worldbody><site name="peg"/>')
    assert [link.name for link in survey(pulled).links] == ["forearm"]


def test_what_stays_where_it_is_gives_no_goal():
    disk = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><body name="disk"><joint name="spin" axis="0 0 1"/>
      <geom type="cylinder" size="0.2 0.02"/></body></worldbody><actuator><motor joint="spin"/></actuator></mujoco>""")
    aim = find_aim(Survey(disk), "")
    assert aim.missing == "no driven hinge or slide moves disk to another place"


@pytest.mark.parametrize(
    ("turn", "along"),
    [("0 0 0", "self.qvel[:, self.dofs][:, 0]"), ("0 0 180", "-self.qvel[:, self.dofs][:, 0]"), ("0 0 90", "")],
)
def test_along_x_is_that_of_the_world(turn: str, along: str):
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><worldbody><geom type="plane" size="9 9 1"/>
      <body name="torso" pos="0 0 1" euler="{turn}"><joint name="x" type="slide" axis="1 0 0"/><geom size="0.1"/>
        <body name="leg"><joint name="hip"/><geom type="capsule" fromto="0 0 0 0 0 -0.8" size="0.05"/></body></body>
      </worldbody><actuator><motor joint="hip"/></actuator></mujoco>""")
    survey = Survey(model)
    assert (survey.base is not None) is bool(along)
    speeds = [v.value for v in StateTable(survey).variables() if v.name == "forward_speed"] if along else []
    assert speeds == [along] * bool(along)
