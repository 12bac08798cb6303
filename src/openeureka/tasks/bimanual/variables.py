"""State variables of the two-handed tasks, in the groups that the original exposes."""

from __future__ import annotations

from ...types import StateSpec, StateVar
from ..hands.shadow import FINGERS
from .scene import SIDES

_POSE = "position [m], quaternion x y z w"
_MOVING = f"{_POSE}, linear velocity [m/s], angular velocity [rad/s]"
_FINGER_NAMES = ("first finger", "middle finger", "ring finger", "little finger", "thumb")


def point_variables(name: str, meaning: str) -> tuple[StateVar, StateVar]:
    """Position and orientation of a point of interest."""
    return (
        StateVar(name=f"{name}_pos", shape=(3,), meaning=f"{meaning} [m], world frame", use="point"),
        StateVar(name=f"{name}_rot", shape=(4,), meaning=f"orientation of {meaning}, quaternion x y z w"),
    )


def thing_variables(name: str, meaning: str) -> tuple[StateVar, ...]:
    """Pose and velocities of a thing."""
    return (
        StateVar(name=f"{name}_pose", shape=(7,), meaning=f"{meaning}: {_POSE}, world frame"),
        *point_variables(name, f"centre of {meaning}"),
        StateVar(
            name=f"{name}_linvel",
            shape=(3,),
            meaning=f"linear velocity of {meaning} [m/s], world frame",
            use="zero_centred",
        ),
        StateVar(
            name=f"{name}_angvel",
            shape=(3,),
            meaning=f"angular velocity of {meaning} [rad/s], world frame",
            use="zero_centred",
        ),
    )


def goal_variables(meaning: str, name: str = "goal") -> tuple[StateVar, ...]:
    """Pose of a goal."""
    return (
        StateVar(name=f"{name}_pose", shape=(7,), meaning=f"{meaning}: {_POSE}, world frame"),
        *point_variables(name, meaning),
    )


FINGERTIPS = tuple(
    StateVar(name=f"{name}_{part}", shape=shape, meaning=f"last joints of the {side} hand's fingers: {meaning}")
    for side, name in zip(SIDES, ("fingertip", "fingertip_another"), strict=True)
    for part, shape, meaning in (("state", (5, 13), _MOVING), ("pos", (5, 3), "position [m]"))
)
PALMS = (*point_variables("right_hand", "right palm"), *point_variables("left_hand", "left palm"))
RIGHT_FINGERS, LEFT_FINGERS = (
    tuple(
        variable
        for finger, name in zip(FINGERS, _FINGER_NAMES, strict=True)
        for variable in point_variables(f"{side}_hand_{finger}", f"tip of the {side} {name}")
    )
    for side in SIDES
)
BASES = (*point_variables("right_base", "right forearm's end"), *point_variables("left_base", "left forearm's end"))
ROTATION_DISTANCE = StateVar(
    name="rotation_distance",
    meaning="angle between the orientations of object and goal [rad], 0 to pi",
    use="zero_centred",
)


def two_handed(observations: int, *groups: StateVar, bases_move: bool = True) -> StateSpec:
    """What a task exposes: its own groups, and what every task observes of the hands."""
    joints = "the 24 joints of the right, then of the left hand"
    inputs = "target angles of 20 joints (-1 at the lower limit, 1 at the upper)"
    if bases_move:
        inputs = f"force and torque on the base, {inputs}"
    actions = 52 if bases_move else 40
    return StateSpec(
        (
            StateVar(name="obs_buf", shape=(observations,), meaning="observation of the policy"),
            *groups,
            *(BASES if bases_move else ()),
            StateVar(name="dof_pos", shape=(48,), meaning=f"angles of {joints} [rad]"),
            StateVar(name="dof_vel", shape=(48,), meaning=f"rates of {joints} [rad/s]", use="zero_centred"),
            StateVar(name="dof_lower_limits", shape=(48,), kind="constant", meaning="lower joint limits [rad]"),
            StateVar(name="dof_upper_limits", shape=(48,), kind="constant", meaning="upper joint limits [rad]"),
            StateVar(name="dof_force_tensor", shape=(48,), meaning=f"torques of the drives of {joints} [N m]"),
            StateVar(
                name="vec_sensor_tensor",
                shape=(60,),
                meaning="contact force [N] and torque [N m] on each of the ten fingertips, in the tip's frame",
            ),
            StateVar(
                name="actions",
                shape=(actions,),
                meaning=f"last action, of the right, then of the left hand: {inputs}",
                use="zero_centred",
            ),
            StateVar(name="num_envs", kind="num_envs", meaning="number of environments"),
        )
    )
