import math

import mujoco
import numpy as np
import pytest

from openeureka.suite.angles import quaternion
from openeureka.suite.dexterity import objects
from openeureka.suite.dexterity.objects import Thing
from openeureka.suite.dexterity.shapes import MATTER

ALL = (
    objects.Egg(),
    objects.Cube(mass=0.07),
    objects.Pot(),
    objects.DoubleDoor(hands_at=1),
    objects.Bottle(),
    objects.CappedPen(),
    objects.Cup(),
    objects.Kettle(),
    objects.Bucket(),
    objects.Scissors(),
    objects.RockerSwitch(side="right"),
)


def placed(
    thing: Thing,
    *,
    pos: tuple[float, float, float] = (0, 0, 0),
    euler: tuple[float, float, float] = (0, 0, 0),
    angles: dict[str, float] | None = None,
    free: bool = False,
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1], **MATTER)
    body = spec.worldbody.add_body(name="object", pos=pos, quat=quaternion(*euler))
    thing.build(body)
    if free:
        body.add_freejoint(name="object")
    model = spec.compile()
    data = mujoco.MjData(model)
    for joint, value in (angles or {}).items():
        data.joint(joint).qpos[:] = value
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.parametrize("thing", ALL, ids=lambda thing: type(thing).__name__)
def test_every_object_touches_hands_and_table(thing: Thing) -> None:
    model, _ = placed(thing, pos=(0, 0, 1))
    for geom in range(1, model.ngeom):
        assert model.geom_contype[geom] == MATTER["contype"] and model.geom_conaffinity[geom] == MATTER["conaffinity"]


@pytest.mark.parametrize(
    ("thing", "mass"),
    [
        (objects.Egg(), 0.0754),
        (objects.Cube(mass=0.0125), 0.0125),
        (objects.Pot(), 4.0),
        (objects.Bottle(), 0.3526),
        (objects.CappedPen(), 0.077),
        (objects.Cup(), 0.6),
        (objects.Kettle(), 1.1),
        (objects.Bucket(), 0.2),
        (objects.Scissors(), 0.208),
    ],
)
def test_parts_add_up_to_the_mass(thing: Thing, mass: float) -> None:
    model, _ = placed(thing)
    assert model.body("object").subtreemass[0] == pytest.approx(mass, rel=1e-6)


def test_the_pot_is_balanced_about_its_base_wherever_it_stands() -> None:
    model, data = placed(objects.Pot(), pos=(0.2, 0, 1))
    assert data.body("object").xipos == pytest.approx((0.2, 0, 1))
    assert model.body("object").inertia == pytest.approx((0.4, 0.4, 0.2))


@pytest.mark.parametrize(
    ("thing", "height"),
    [
        (objects.Cube(mass=0.07), 0.025),
        (objects.Pot(), 0.065),
        (objects.Cup(), 0.084),
        (objects.Kettle(), 0.074),
        (objects.Bucket(), 0.053),
        (objects.Scissors(), 0.008),
    ],
)
def test_objects_rest_upright_at_the_height_of_their_base(thing: Thing, height: float) -> None:
    model, data = placed(thing, pos=(0, 0, height + 0.001), free=True)
    model.opt.timestep = 1 / 120
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    mujoco.mj_step(model, data, nstep=240)
    assert data.body("object").xpos[2] == pytest.approx(height, abs=2e-3)
    assert data.body("object").xmat[8] > math.cos(0.05)


# World positions of the points to grasp, from the forward kinematics of the original models, to within 3 mm.
@pytest.mark.parametrize(
    ("hands_at", "pitch", "angle", "right", "left"),
    [
        (-1, math.pi, 0.0, (0.048, 0.037, 0.717), (0.046, -0.030, 0.717)),
        (1, 0.0, 0.0, (0.032, 0.037, 0.683), (0.034, -0.030, 0.683)),
        (-1, math.pi, 1.57, (0.398, 0.466, 0.717), (0.398, -0.460, 0.717)),
        (1, 0.0, 1.57, (-0.398, 0.386, 0.683), (-0.398, -0.380, 0.683)),
    ],
)
def test_door_handles_are_where_the_originals_are(hands_at, pitch, angle, right, left) -> None:
    _, data = placed(
        objects.DoubleDoor(hands_at=hands_at),
        pos=(0, 0, 0.7),
        euler=(0, pitch, 0),
        angles={"door_right_hinge": angle, "door_left_hinge": angle},
    )
    assert data.site("door_right_handle").xpos == pytest.approx(right, abs=3e-3)
    assert data.site("door_left_handle").xpos == pytest.approx(left, abs=3e-3)


@pytest.mark.parametrize(
    ("angle", "right"), [(-0.59, (0.152, -0.032, 0.6)), (-0.3, (0.151, 0.033, 0.6)), (0.4, (0.076, 0.167, 0.6))]
)
def test_scissors_handles_are_where_the_originals_are(angle, right) -> None:
    _, data = placed(objects.Scissors(), pos=(0, 0, 0.6), euler=(0, 0, math.pi / 2), angles={"scissors_hinge": angle})
    assert data.site("scissors_right_handle").xpos == pytest.approx(right, abs=2e-3)
    assert data.site("scissors_left_handle").xpos == pytest.approx((0.15, -0.10, 0.6), abs=2e-3)


@pytest.mark.parametrize("angle", [0.0, 0.5585])
def test_a_switch_rocks_its_near_end_up_by_at_most_a_centimetre(angle: float) -> None:
    _, data = placed(
        objects.RockerSwitch(side="right"),
        pos=(0, 0.2, 0.65),
        euler=(math.pi, 1.57, 0),
        angles={"switch_right_rocker": angle},
    )
    expected = (0.011 + 0.02 * math.cos(angle), 0.2, 0.692 + 0.02 * math.sin(angle))
    assert data.site("switch_right_handle").xpos == pytest.approx(expected, abs=2e-3)


def test_the_bottles_cap_point_is_a_centimetre_off_its_base_and_leaves_with_the_cap() -> None:
    _, closed = placed(objects.Bottle())
    _, open_ = placed(objects.Bottle(), angles={"bottle_cap_slide": 0.05, "bottle_cap_turn": 2.0})
    assert math.hypot(*closed.site("bottle_cap_up").xpos) == pytest.approx(0.0103, abs=1e-4)
    assert open_.site("bottle_cap_up").xpos[2] == pytest.approx(0.05)


def test_the_pens_cap_comes_off_away_from_the_body() -> None:
    _, data = placed(objects.CappedPen(), angles={"pen_cap_slide": 0.13})
    assert data.site("pen_right_handle").xpos == pytest.approx((0, 0, -0.23))


def test_the_bucket_is_hollow() -> None:
    model, data = placed(objects.Bucket(), pos=(0, 0, 1))
    geom = np.zeros(1, dtype=np.int32)
    depth = mujoco.mj_ray(model, data, [0.01, 0.01, 1.2], [0, 0, -1], None, 1, -1, geom)
    assert 1.2 - depth == pytest.approx(1 - 0.053 + 0.004)
