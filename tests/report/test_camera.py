import mujoco
import pytest

from openeureka.report.camera import camera
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
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return camera(model, data, view)


def test_everything_that_moves_just_fits():
    eye = look(mujoco.MjModel.from_xml_string(TWO_CUBES))
    # The boxes reach 4 m to either side of (3, 0, 5) and 0.5 m towards the camera. At a field of view of 90 degrees, a
    # picture is twice as high as it is far, and 4/3 of that wide: the near faces are 4 / (4/3) = 3 m off.
    assert eye.lookat == pytest.approx([3.0, 0.0, 5.0])
    assert eye.distance == pytest.approx(3.5)


def test_a_tall_scene_is_fitted_by_its_height():
    upright = TWO_CUBES.replace("3 -3.5 5", "3 0 1.5").replace("3 3.5 5", "3 0 8.5")
    assert look(mujoco.MjModel.from_xml_string(upright)).distance == pytest.approx(4.5)


def test_a_robot_that_can_leave_is_followed_and_two_hands_are_not():
    assert _followed("ant") == "torso"
    assert _followed("cartpole") == "cart"
    assert _followed("franka_cabinet") is None
    assert _followed("shadow_hand_catch_underarm") is None


def test_a_camera_of_the_model_goes_first():
    own = TWO_CUBES.replace("<worldbody>", '<worldbody><camera pos="0 0 9"/>')
    eye = look(mujoco.MjModel.from_xml_string(own))
    assert (eye.type, eye.fixedcamid) == (mujoco.mjtCamera.mjCAMERA_FIXED, 0)


def _followed(env: str) -> str | None:
    model = registry.get(env).compile_model()
    eye = look(model)
    return model.body(eye.trackbodyid).name if eye.type == mujoco.mjtCamera.mjCAMERA_TRACKING else None
