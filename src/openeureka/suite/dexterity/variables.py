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
        StateVar(f"{name}_pos", f"{meaning}: position [m], world frame", (3,), use=use),
        StateVar(f"{name}_rot", f"{meaning}: orientation, quaternion x y z w", (4,)),
    )


def thing_variables(name: str, meaning: str, *, fixed: bool = False) -> tuple[StateVar, ...]:
    """Pose and velocities of a thing. Those of a fixed one never change, so the typed grammar has no use for them."""
    motion: StateUse = "raw" if fixed else "zero_centred"
    return (
        StateVar(f"{name}_pose", f"{meaning}: {_POSE}, world frame", (7,)),
        *point_variables(name, meaning, use="raw" if fixed else "point"),
        StateVar(f"{name}_linvel", f"{meaning}: linear velocity [m/s], world frame", (3,), use=motion),
        StateVar(f"{name}_angvel", f"{meaning}: angular velocity [rad/s], world frame", (3,), use=motion),
    )


def goal_variables(meaning: str, name: str = "goal", *, use: StateUse = "point") -> tuple[StateVar, ...]:
    """Pose of a goal; `use` is `raw` where its position means nothing."""
    return (
        StateVar(f"{name}_pose", f"{meaning}: {_POSE}, world frame", (7,)),
        *point_variables(name, meaning, use=use),
    )


FINGERTIPS = tuple(
    StateVar(f"{name}_{part}", f"last joints of the {side} hand's fingers: {meaning}", shape)
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
    "rotation_distance", "angle between the orientations of object and goal [rad], 0 to pi", use="zero_centred"
)


def raw_variables(scene: Scene, things: Collection[str]) -> tuple[StateVar, ...]:
    """Tensors from which published rewards may read the other variables, and the rows of `things` in them."""
    names = " and ".join(scene.things)
    parts = ", ".join(f"{placed.thing.bodies} of {name}" for name, placed in scene.things.items())
    bodies = 2 * HAND_BODIES + sum(placed.thing.bodies for placed in scene.things.values())
    goals = ("goal", *(name for name in scene.goals if name.startswith("goal_")))
    return (
        StateVar(
            "rigid_body_states",
            f"bodies, each {_MOVING}: {HAND_BODIES} of the right hand, {HAND_BODIES} of the left, {parts}",
            (bodies, 13),
        ),
        *(
            StateVar(
                f"{name}_handles", f"rows of {name}_state in rigid_body_states, as integers", (5,), kind="constant"
            )
            for name in ("fingertip", "fingertip_another")
        ),
        StateVar("root_state_tensor", f"right hand, left hand, {names}, each {_MOVING}", (2 + len(scene.things), 13)),
        *(
            StateVar(f"{name}_indices", f"row of {name} in root_state_tensor, {row}", kind="int")
            for row, name in enumerate(scene.things, start=2)
            if name in things
        ),
        *(
            StateVar(
                f"{name}_states",
                f"unused, far above the table: {_POSE}, then zeros"
                if scene.marker and name == "goal"
                else f"{_POSE}, then zeros, as the original has {name}",
                (13,),
            )
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
            StateVar("obs_buf", "observation of the policy", (observations,)),
            *groups,
            *(BASES if scene.hands_move else ()),
            StateVar("dof_pos", f"angles of {joints} [rad]", (48,)),
            StateVar("dof_vel", f"rates of {joints} [rad/s]", (48,), use="zero_centred"),
            StateVar("dof_lower_limits", "lower joint limits [rad]", (48,), kind="constant"),
            StateVar("dof_upper_limits", "upper joint limits [rad]", (48,), kind="constant"),
            StateVar("dof_force_tensor", f"torques of the drives of {joints} [N m]", (48,)),
            StateVar(
                "vec_sensor_tensor",
                "contact force [N] and torque [N m] on each of the ten fingertips, in the tip's frame",
                (60,),
            ),
            StateVar(
                "actions", f"last action, of the right, then of the left hand: {inputs}", (actions,), use="zero_centred"
            ),
            *raw_variables(scene, {group.name.removesuffix("_pose") for group in groups}),
            StateVar("num_envs", "number of environments", kind="num_envs"),
        )
    )
