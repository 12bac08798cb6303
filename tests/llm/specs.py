"""State tables like those of the tasks, but fixed here: golden texts must not change when a task does."""

from openeureka.types import StateSpec, StateVar, TaskContext

CARTPOLE = StateSpec(
    (
        StateVar(name="dof_pos", shape=(2,), meaning="cart position [m], pole angle [rad]"),
        StateVar(name="cart_position", meaning="cart position [m], 0 is the middle", use="zero_centred"),
        StateVar(name="pole_angle", meaning="pole angle from upright [rad]", use="zero_centred"),
        StateVar(name="actions", shape=(1,), meaning="last action", use="zero_centred"),
        StateVar(name="dt", kind="float", meaning="time between two actions [s]"),
        StateVar(name="num_envs", kind="num_envs", meaning="number of environments"),
    )
)
ANT = StateSpec(
    (
        StateVar(name="root_states", shape=(13,), meaning="position, quaternion, velocities"),
        StateVar(name="torso_velocity", shape=(3,), meaning="forward, left, up [m/s]", use="directional"),
        StateVar(name="up_proj", meaning="1 when upright", use="directional"),
        StateVar(name="dof_vel", shape=(8,), meaning="joint rates [rad/s]", use="zero_centred"),
    )
)
HAND = StateSpec(
    (
        StateVar(name="object_position", shape=(3,), meaning="object [m]", use="point"),
        StateVar(name="goal_position", shape=(3,), meaning="goal [m]", use="point"),
        StateVar(name="fingertip_height", shape=(5,), meaning="heights [m]", use="directional"),
        StateVar(name="sensors", shape=(5, 6), meaning="wrench of each fingertip", use="zero_centred"),
    )
)
HOPPER = StateSpec((StateVar(name="foot_position", shape=(3,), meaning="foot [m]", use="point"),))
"""A point with nothing to compare it to."""

SPECS = {"cartpole": CARTPOLE, "ant": ANT, "hand": HAND, "hopper": HOPPER}


def context(env: str) -> TaskContext:
    return TaskContext(
        env=env,
        description="to balance the pole",
        state=SPECS[env],
        source="class Cartpole:\n\n    def observe(self, s):\n        return s['dof_pos']\n",
    )
