"""State variables of the two-handed tasks, in the groups that the original exposes."""

from __future__ import annotations

from collections.abc import Collection

from ...types import StateSpec, StateUse, StateVar
from ..shadow import FINGERS
from .scene import HAND_BODIES, SIDES, Scene

_POSE = "position [m], quaternion x y z w"
_MOVING = f"{_POSE}, linear velocity [m/s], angular velocity [rad/s]"
_FINGER_NAMES = ("first finger", "middle finger", "ring finger", "little finger", "thumb")


def point_variables(name: str, meaning: str, *, use: StateUse = "point") -> tuple[StateVar, StateVar]:
    """Position and orientation of a point of interest."""
    return (
        StateVar(name=f"{name}_pos", shape=(3,), meaning=f"{meaning}: position [m], world frame", use=use),
        StateVar(name=f"{name}_rot", shape=(4,), meaning=f"{meaning}: orientation, quaternion x y z w"),
    )


def thing_variables(name: str, meaning: str) -> tuple[StateVar, ...]:
    """Pose and velocities of a thing."""
    rate = {"shape": (3,), "use": "zero_centred"}
    return (
        StateVar(name=f"{name}_pose", shape=(7,), meaning=f"{meaning}: {_POSE}, world frame"),
        *point_variables(name, meaning),
        StateVar(name=f"{name}_linvel", meaning=f"{meaning}: linear velocity [m/s], world frame", **rate),
        StateVar(name=f"{name}_angvel", meaning=f"{meaning}: angular velocity [rad/s], world frame", **rate),
    )


def goal_variables(meaning: str, name: str = "goal", *, use: StateUse = "point") -> tuple[StateVar, ...]:
    """Pose of a goal; `use` is `raw` where its position means nothing."""
    return (
        StateVar(name=f"{name}_pose", shape=(7,), meaning=f"{meaning}: {_POSE}, world frame"),
        *point_variables(name, meaning, use=use),
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
BASES = tuple(
    variable
    for side in SIDES
    for variable in point_variables(f"{side}_base", f"lower end of the {side} forearm", use="raw")
)
ROTATION_DISTANCE = StateVar(
    name="rotation_distance",
    meaning="angle between the orientations of object and goal [rad], 0 to pi",
    use="zero_centred",
)


def raw_variables(scene: Scene, things: Collection[str]) -> tuple[StateVar, ...]:
    """The tensors that published rewards may read the other variables from, and the rows that `things` are at."""
    names = " and ".join(scene.things)
    parts = ", ".join(f"{placed.thing.bodies} of {name}" for name, placed in scene.things.items())
    bodies = 2 * HAND_BODIES + sum(placed.thing.bodies for placed in scene.things.values())
    goals = ("goal", *(name for name in scene.goals if name.startswith("goal_")))
    return (
        StateVar(
            name="rigid_body_states",
            shape=(bodies, 13),
            meaning=f"bodies, each {_MOVING}: {HAND_BODIES} of the right hand, {HAND_BODIES} of the left, {parts}",
        ),
        *(
            StateVar(
                name=f"{name}_handles",
                shape=(5,),
                kind="constant",
                meaning=f"rows of {name}_state in rigid_body_states, as integers",
            )
            for name in ("fingertip", "fingertip_another")
        ),
        StateVar(
            name="root_state_tensor",
            shape=(2 + len(scene.things), 13),
            meaning=f"right hand, left hand, {names}, each {_MOVING}",
        ),
        *(
            StateVar(name=f"{name}_indices", kind="int", meaning=f"row of {name} in root_state_tensor, {row}")
            for row, name in enumerate(scene.things, start=2)
            if name in things
        ),
        *(
            StateVar(name=f"{name}_states", shape=(13,), meaning=f"{_POSE}, then zeros, as the original has {name}")
            for name in goals
        ),
    )


def two_handed(scene: Scene, observations: int, *groups: StateVar) -> StateSpec:
    """What a task exposes: its own groups, and what every task observes of the hands."""
    joints = "the 24 joints of the right, then of the left hand"
    inputs = "target angles of 20 joints (-1 at the lower limit, 1 at the upper)"
    if scene.hands_move:
        inputs = f"force and torque on the base, {inputs}"
    actions = 52 if scene.hands_move else 40
    return StateSpec(
        (
            StateVar(name="obs_buf", shape=(observations,), meaning="observation of the policy"),
            *groups,
            *(BASES if scene.hands_move else ()),
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
            *raw_variables(scene, {group.name.removesuffix("_pose") for group in groups}),
            StateVar(name="num_envs", kind="num_envs", meaning="number of environments"),
        )
    )
