import mujoco
import pytest

from openeureka.film.camera import MARGIN, Camera
from openeureka.film.stage import Stage
from openeureka.tasks import registry
from openeureka.tasks.task import View

ALONG_X = View(azimuth=0.0, elevation=0.0)
TWO_CUBES = """
<mujoco>
  <visual><global fovy="90"/></visual>
  <worldbody>
    <geom type="plane" size="9 9 1"/>
    <body pos="3 -3.5 5"><freejoint/><geom type="box" size=".5 .5 .5"/></body>
    <body pos="3 3.5 5"><freejoint/><geom type="box" size=".5 .5 .5"/></body>
  </worldbody>
</mujoco>
"""


def look(model: mujoco.MjModel, view: View = ALONG_X) -> mujoco.MjvCamera:
    return director(model, view).eye


def director(model: mujoco.MjModel, view: View = ALONG_X) -> Camera:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return Camera(model, data, view, aspect=4 / 3)


def test_everything_that_moves_just_fits():
    eye = look(mujoco.MjModel.from_xml_string(TWO_CUBES))
    # The boxes reach 4 m to either side of (3, 0, 5) and 0.5 m towards the camera. With a field of view of 90 degrees,
    # a picture at distance d is 2 d high and 4/3 of that wide. So the near faces are 4 / (4/3) = 3 m away.
    assert eye.lookat == pytest.approx([3.0, 0.0, 5.0])
    assert eye.distance == pytest.approx(3.5 * MARGIN)


def test_a_tall_scene_is_fitted_by_its_height():
    upright = TWO_CUBES.replace("3 -3.5 5", "3 0 1.5").replace("3 3.5 5", "3 0 8.5")
    assert look(mujoco.MjModel.from_xml_string(upright)).distance == pytest.approx(4.5 * MARGIN)


def test_a_robot_that_can_leave_is_followed_and_two_hands_are_not():
    assert _followed("ant") == "torso"
    assert _followed("cartpole") == "cart"
    assert _followed("franka_cabinet") is None
    assert _followed("shadow_hand_catch_underarm") is None


@pytest.mark.parametrize(
    ("cameras", "chosen"),
    [
        # The cubes reach 4 m to either side and up to z = 5.5 m. They just fit from 4 / (4/3) = 3 m above that.
        ('<camera pos="3 0 8.6" euler="0 0 90" fovy="90"/>', 0),
        ('<camera pos="3 0 8.4" euler="0 0 90" fovy="90"/>', None),
        ('<camera pos="3 0 2" euler="0 0 90" fovy="90"/>', None),  # looks down from below the cubes
        ('<camera pos="3 0 90" euler="0 0 90" fovy="90"/>', None),  # 4 / (4/3 * 84.5) of the way to the edge: too small
        ('<camera pos="3 0 2" fovy="90"/><camera pos="3 0 9" euler="0 0 90" fovy="90"/>', 1),
    ],
)
def test_a_camera_of_the_model_goes_first_if_it_has_all_in_sight_that_moves(cameras: str, chosen: int | None):
    eye = look(mujoco.MjModel.from_xml_string(TWO_CUBES.replace("<worldbody>", f"<worldbody>{cameras}")))
    fixed = eye.fixedcamid if eye.type == mujoco.mjtCamera.mjCAMERA_FIXED else None
    assert fixed == chosen


@pytest.mark.parametrize(("mode", "chosen"), [("fixed", False), ("trackcom", True)])
def test_a_camera_on_what_moves_counts_if_it_keeps_its_direction(mode: str, chosen: bool):
    carried = TWO_CUBES.replace(
        'size=".5 .5 .5"/></body>',
        f'size=".5 .5 .5"/><camera mode="{mode}" pos="0 -3.5 4" \
        euler="0 0 90" fovy="90"/></body>',
        2,
    )
    eye = look(mujoco.MjModel.from_xml_string(carried))
    assert (eye.type == mujoco.mjtCamera.mjCAMERA_FIXED) == chosen


def test_a_swept_view_has_an_arm_in_sight_wherever_it_turns():
    arm = """
    <mujoco><worldbody>
      <body><joint axis="0 0 1" range="-180 180" limited="true"/>
        <geom type="capsule" fromto="0 0 0 1 0 0" size="0.1"/></body>
    </worldbody></mujoco>
    """
    model = mujoco.MjModel.from_xml_string(arm)
    at_start, swept = look(model), look(model, View(azimuth=0.0, elevation=0.0, swept=True))
    assert at_start.lookat == pytest.approx([0.5, 0.0, 0.0])
    assert swept.lookat == pytest.approx([0.0, 0.0, 0.0], abs=0.1) and swept.distance > 2.0 * at_start.distance


def _followed(env: str) -> str | None:
    model = registry.get(env).compile_model()
    eye = director(model).hand_over()
    return model.body(eye.trackbodyid).name if eye.type == mujoco.mjtCamera.mjCAMERA_TRACKING else None


def moved(to: float) -> tuple[Camera, mujoco.MjData]:
    """The camera on a driven cart, and the cart's data, 0.1 s after it jumped to `to` [m] along y."""
    model = mujoco.MjModel.from_xml_string("""
    <mujoco><worldbody><body><joint name="rail" type="slide" axis="0 1 0"/><geom type="box" size=".5 .5 .5"/></body>
    </worldbody><actuator><motor joint="rail"/></actuator></mujoco>
    """)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = Camera(model, data, ALONG_X)
    data.qpos[0] = to
    mujoco.mj_forward(model, data)
    found.follow(data, 0.1)
    return found, data


def test_the_camera_eases_after_what_moves_and_never_lets_it_out():
    found, data = moved(0.5)
    assert 0.0 < found.eye.lookat[1] < 0.5
    assert found.sees(data) <= 0.99  # some space is left to the edge of the picture
    for _ in range(200):
        found.follow(data, 0.1)
    assert found.eye.lookat[1] == pytest.approx(0.5, abs=1e-3)
    assert found.sees(data) == pytest.approx(1 / MARGIN, abs=0.05)


def test_a_scene_that_begins_anew_is_cut_to():
    found, _ = moved(50.0)
    assert found.eye.lookat[1] == pytest.approx(50.0)


@pytest.mark.parametrize("env", ["cartpole", "ant", "quadcopter", "shadow_hand_swing_cup"])
def test_what_moves_fills_the_picture_and_stays_in_it(env: str):
    stage = Stage(env, "random", seed=0)
    needed = []
    for _ in range(round(2.0 / stage.dt)):
        needed.append(stage.director.sees(stage.data))
        stage.step()
    assert max(needed) <= 1.0 + 1e-6
    assert min(needed) > 0.5
