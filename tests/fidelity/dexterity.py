"""The twenty two-handed tasks as their originals compute them, in NumPy.

Object geometry is that of the published URDF files, in their own links' frames (y up); rewards, resets and successes
are written from the published formulas. Known deviations (docs/concepts/benchmark.md) are marked `ours`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import pi

import numpy as np

from .raw import Array, Worlds, about, angle_between, conj, euler, mul, norm, to_unit_range, turn

FINGERS = ("ff", "mf", "rf", "lf", "th")
# Bodies and joints of one hand in the order of the MJCF file. All arrays have this order.
BODIES = (
    "hand mount", "forearm", "wrist", "palm",
    "ffknuckle", "ffproximal", "ffmiddle", "ffdistal", "mfknuckle", "mfproximal", "mfmiddle", "mfdistal",
    "rfknuckle", "rfproximal", "rfmiddle", "rfdistal",
    "lfmetacarpal", "lfknuckle", "lfproximal", "lfmiddle", "lfdistal",
    "thbase", "thproximal", "thhub", "thmiddle", "thdistal",
)  # fmt: skip
JOINTS = (
    "WRJ1", "WRJ0", "FFJ3", "FFJ2", "FFJ1", "FFJ0", "MFJ3", "MFJ2", "MFJ1", "MFJ0", "RFJ3", "RFJ2", "RFJ1", "RFJ0",
    "LFJ4", "LFJ3", "LFJ2", "LFJ1", "LFJ0", "THJ4", "THJ3", "THJ2", "THJ1", "THJ0",
)  # fmt: skip
LOWER = np.array([-0.489, -0.698, *[-0.349, 0, 0, 0] * 3, 0, -0.349, 0, 0, 0, -1.047, 0, -0.209, -0.524, -1.571])
UPPER = np.array([0.140, 0.489, *[0.349, *[1.571] * 3] * 3, 0.785, 0.349, *[1.571] * 3, 1.047, 1.222, 0.209, 0.524, 0])
MOUNT = mul(about((1, 0, 0), pi / 2), about((0, 0, 1), pi))
"""Orientation of the hand in its MJCF file, which the original keeps: intrinsic rotations about x, then z."""
UPRIGHT = np.array([0, 0, 0, 1.0])
LINK = euler(pi / 2, 0, -pi / 2)  # the fixed joint between base and link_1 of every PartNet file


@dataclass(frozen=True)
class Moving:
    """A moving link: its joint's name in our model, its kind, and its origin and axis in the frame of the link that all
    moving links hang on (link_1 or link_0)."""

    joint: str
    origin: tuple[float, float, float]
    axis: tuple[float, float, float]
    hinge: bool


NOTHING: tuple[Moving, ...] = ()
PARTS: Mapping[str, tuple[Moving, ...]] = {
    "pot": (Moving("pot_lid", (0, 0, 0), (0, 1, 0), False),),
    "door": (
        Moving("door_right_hinge", (-0.4265270657166128, 0.483292, 0.008461858680020029), (0, -1, 0), True),
        Moving("door_left_hinge", (0.42040686074842226, 0.483292, 0.0055998888476049835), (0, 1, 0), True),
    ),
    "pen": (Moving("pen_cap_slide", (0, 0, 0), (0, -1, 0), False),),
    "cup": (Moving("cup_lid", (-0.0013007224518146773, 0, -0.006225716369432219), (0, 1, 0), False),),
    "kettle": (Moving("kettle_lid", (0, 0, 0), (0, 1, 0), False),),
    "bucket": NOTHING,
    "scissors": (Moving("scissors_hinge", (-0.0698251662, 0, 0.0034203225936), (0, 1, 0), True),),
    "right_switch": (
        Moving("switch_right_rocker", (0.0502285, -0.010858965876808951, 0.041670398045619433), (-1, 0, 0), True),
    ),
    "left_switch": (
        Moving("switch_left_rocker", (0.0502285, -0.010858965876808951, 0.041670398045619433), (-1, 0, 0), True),
    ),
}  # fmt: skip


def rows(w: Worlds, name: str, kind: str) -> Array:
    """(N, bodies, 13): base, link_1 and moving links of one thing."""
    base = w.body(name)
    if kind in ("egg", "cube"):
        return base[:, None]
    body = base.copy()
    body[:, 3:7] = mul(base[:, 3:7], LINK)
    found = [base, body]
    if kind == "bottle":  # the cap slides along y and turns about it; a massless link between has the cap's pose
        origin = np.array((0.007005959241653967, 0, 0.007542109902568375))
        up, slide, spin = np.array((0, 1.0, 0)), w.angle("bottle_cap_slide"), w.angle("bottle_cap_turn")
        rates = np.outer(w.rate("bottle_cap_slide"), up), np.outer(w.rate("bottle_cap_turn"), up)
        cap = place(body, origin + np.outer(slide, up), about(up, spin), *rates)
        return np.stack([*found, cap, cap], axis=1)
    for part in PARTS[kind]:
        angle, axis, still = w.angle(part.joint), np.array(part.axis, dtype=float), np.zeros((w.count, 3))
        rate = np.outer(w.rate(part.joint), axis)
        if part.hinge:
            found.append(place(body, np.array(part.origin), about(axis, angle), still, rate))
        else:
            found.append(place(body, np.array(part.origin) + np.outer(angle, axis), UPRIGHT, rate, still))
    return np.stack(found, axis=1)


def place(parent: Array, offset: Array, spin: Array, slides: Array, spins: Array) -> Array:
    """State (N, 13) of a link from that of its parent: offset, rotation and the rates of both in the parent's frame."""
    rot = parent[:, 3:7]
    arm = turn(rot, np.broadcast_to(offset, (len(parent), 3)))
    linvel = parent[:, 7:10] + np.cross(parent[:, 10:], arm) + turn(rot, slides)
    angvel = parent[:, 10:] + turn(rot, spins)
    turned = mul(rot, np.broadcast_to(spin, (len(parent), 4)))
    return np.concatenate((parent[:, :3] + arm, turned, linvel, angvel), axis=-1)


@dataclass(frozen=True)
class Original:
    """What the original code of one task says.

    `handles`: row of rigid_body_states and offset in that body's frame, by the name of the variables.
    `judge`: reward, failure and success of every world, from state variables.
    """

    steps: int
    observations: int
    things: Mapping[str, str]
    """Kind of each thing."""
    starts: Mapping[str, tuple[tuple[float, float, float], tuple[float, float, float] | None]]
    """Position and Euler angles of each thing at the start; None where orientations are random."""
    goals: Mapping[str, tuple[tuple[float, float, float], Array | None]]
    hands: tuple[tuple[tuple[float, float, float], tuple[float, float, float]], ...]
    extras: tuple[str, ...]
    """What is observed after the hands and the object."""
    judge: Callable[[Mapping[str, Array]], tuple[Array, Array, Array]]
    handles: Mapping[str, tuple[int, tuple[float, float, float]]] = field(default_factory=dict)
    palms: bool = True
    fingers: tuple[str, ...] = ("right", "left")
    point: str = "hand"
    fixed: bool = False
    noise: bool = False
    position_noise: float = 0.0
    marker: tuple[tuple[float, float, float], Array] | None = None
    posed_goals: tuple[str, ...] = ("goal",)
    """Goals whose whole pose is a state variable, too."""
    exposed: tuple[str, ...] = ("object",)
    padding: int = 0
    ours: Callable[[Mapping[str, Array]], dict[str, Array]] = lambda s: {}
    """Variables that the original does not have, from those that it has."""


def state(task: Original, w: Worlds, actions: Array, goals: Mapping[str, Array]) -> dict[str, Array]:
    """Every state variable but `obs_buf`; goals are given, because some of them are random."""
    hands = [np.stack([w.body(f"{side}_{body}") for body in BODIES], axis=1) for side in ("right", "left")]
    objects = [rows(w, name, kind) for name, kind in task.things.items()]
    bodies = np.concatenate((*hands, *objects), axis=1)
    tips = np.array([7, 11, 15, 20, 25])
    joints = [f"{side}_{joint}" for side in ("right", "left") for joint in JOINTS]
    s: dict[str, Array] = {
        "rigid_body_states": bodies,
        "fingertip_handles": tips,
        "fingertip_another_handles": tips + 26,  # ours: the original reads the right hand's rows again
        "root_state_tensor": np.stack([bodies[:, 0], bodies[:, 26], *(thing[:, 0] for thing in objects)], axis=1),
        "fingertip_state": bodies[:, tips],
        "fingertip_pos": bodies[:, tips, :3],
        "fingertip_another_state": bodies[:, tips + 26],
        "fingertip_another_pos": bodies[:, tips + 26, :3],
        "dof_pos": np.stack([w.angle(joint) for joint in joints], axis=1),
        "dof_vel": np.stack([w.rate(joint) for joint in joints], axis=1),
        "dof_lower_limits": np.tile(LOWER, 2),
        "dof_upper_limits": np.tile(UPPER, 2),
        "dof_force_tensor": np.stack([w.drive(joint) for joint in joints], axis=1),
        "vec_sensor_tensor": np.concatenate(
            [w.wrench(f"{side}_{finger}distal") for side in ("right", "left") for finger in FINGERS], axis=1
        ),
        "actions": actions,
        "num_envs": np.array(w.count),
    }
    for row, name in enumerate(task.things):
        if name not in task.exposed:
            continue
        root = objects[row][:, 0]
        s |= {f"{name}_pose": root[:, :7], f"{name}_pos": root[:, :3], f"{name}_rot": root[:, 3:7]}
        s |= {f"{name}_linvel": root[:, 7:10], f"{name}_angvel": root[:, 10:], f"{name}_indices": np.array(2 + row)}
    for name, pose in goals.items():
        s |= {f"{name}_pos": pose[:, :3], f"{name}_rot": pose[:, 3:]}
        if name in task.posed_goals:
            s[f"{name}_pose"] = pose
        if name.startswith("goal"):
            s[f"{name}_states"] = np.pad(pose, ((0, 0), (0, 6)))
    if "towards object goal" in task.extras or task.judge is swing:
        s["rotation_distance"] = angle_between(s["object_rot"], s["goal_rot"])  # ours
    if "goal_another" in goals:
        s["rotation_distance_another"] = angle_between(s["object_another_rot"], s["goal_another_rot"])  # ours
    if task.marker:
        pos, rot = task.marker
        s["goal_states"] = np.tile(np.concatenate((pos, rot, np.zeros(6))), (w.count, 1))
    for side, hand in zip(("right", "left"), hands, strict=True):
        palm = hand[:, 3]
        if task.palms:
            s[f"{side}_hand_pos"] = palm[:, :3] + turn(palm[:, 3:7], np.tile((0, -0.02, 0.08), (w.count, 1)))
            s[f"{side}_hand_rot"] = palm[:, 3:7]
        if side in task.fingers:
            for finger, tip in zip(FINGERS, tips, strict=True):
                end = hand[:, tip]
                s[f"{side}_hand_{finger}_pos"] = end[:, :3] + turn(end[:, 3:7], np.tile((0, 0, 0.02), (w.count, 1)))
                s[f"{side}_hand_{finger}_rot"] = end[:, 3:7]
        if not task.fixed:
            s |= {f"{side}_base_pos": hand[:, 0, :3], f"{side}_base_rot": hand[:, 0, 3:7]}  # ours: rewards see it, too
    for name, (row, offset) in task.handles.items():
        body = bodies[:, row]
        pos = body[:, :3] + turn(body[:, 3:7], np.tile(offset, (w.count, 1)))
        if name in ("bottle", "bottle_cap", "pot_right_handle", "pot_left_handle"):
            s[f"{name}_pos"] = pos
        elif name == "bottle_cap_up":
            s[name] = pos
        else:
            s |= {f"{name}_pos": pos, f"{name}_rot": body[:, 3:7]}
    return s | task.ours(s)


def observation(task: Original, s: Mapping[str, Array]) -> Array:
    """obs_buf, from the state variables `s` alone."""
    per_hand = []
    for number, (side, tips) in enumerate((("right", "fingertip_state"), ("left", "fingertip_another_state"))):
        dofs, wrenches = slice(24 * number, 24 * number + 24), slice(30 * number, 30 * number + 30)
        half = s["actions"].shape[1] // 2
        parts = [
            to_unit_range(s["dof_pos"][:, dofs], LOWER, UPPER),
            0.2 * s["dof_vel"][:, dofs],
            10 * s["dof_force_tensor"][:, dofs],
            s[tips].reshape(len(s[tips]), 65),
            10 * s["vec_sensor_tensor"][:, wrenches],
        ]
        if not task.fixed:
            start = mul(euler(*task.hands[number][1]), MOUNT)
            spin = mul(s[f"{side}_base_rot"], conj(start))  # ours: the turn since the start, not Euler angles
            parts += [s[f"{side}_{task.point}_pos"], 2 * spin[:, :3] * np.sign(spin[:, 3:])]
        per_hand += [*parts, s["actions"][:, half * number : half * (number + 1)]]
    seen = [*per_hand, s["object_pose"], s["object_linvel"], 0.2 * s["object_angvel"]]
    for name in task.extras:
        if name.startswith("towards "):
            thing, goal = name.split()[1:]
            seen += [s[f"{goal}_pose"], mul(s[f"{thing}_rot"], conj(s[f"{goal}_rot"]))]
        elif name.startswith("thing "):
            thing = name.split()[1]
            seen += [s[f"{thing}_pose"], s[f"{thing}_linvel"], 0.2 * s[f"{thing}_angvel"]]
        else:
            seen.append(s[name])
    return np.pad(np.concatenate(seen, axis=-1), ((0, 0), (0, task.padding)))


# --- rewards, resets and successes ---


def fingers(s: Mapping[str, Array], side: str, point: Array) -> Array:
    """(N,) Sum of the distances of five fingertips from a point [m]."""
    return sum((norm(point - s[f"{side}_hand_{finger}_pos"]) for finger in FINGERS), np.zeros(len(point)))


def gap(s: Mapping[str, Array], thing: str = "object", goal: str = "goal") -> tuple[Array, Array]:
    return norm(s[f"{goal}_pos"] - s[f"{thing}_pos"]), angle_between(s[f"{thing}_rot"], s[f"{goal}_rot"])


def catch(weight: float, floor: float):
    def judge(s):
        d, theta = gap(s)
        return np.exp(-0.2 * (weight * d + theta)), s["object_pos"][:, 2] <= floor, d < 0.03

    return judge


def over2underarm(s):
    d, theta = gap(s)
    away = [norm(s["right_base_pos"] - (0, 0, 0.5)) > 0.1, norm(s["left_base_pos"] - (0, -0.8, 0.5)) > 0.1]
    return np.exp(-0.2 * (20 * d + theta)), away[0] | away[1] | (s["object_pos"][:, 2] <= 0.3), d < 0.03


def abreast(s):
    d, theta = gap(s)
    palms = [s[f"{side}_hand_pos"] - turn(s[f"{side}_hand_rot"], np.tile((0, -0.02, 0.08), (len(d), 1))) for side in
             ("right", "left")]  # fmt: skip
    away = (norm(palms[0] - (-0.3, -0.55, 0.5)) > 0.1) | (norm(palms[1] - (-0.3, -1.15, 0.5)) > 0.1)
    return np.exp(-0.2 * (50 * d + theta)), away | (s["object_pos"][:, 2] <= 0.2), d < 0.03


def two_catch(s):
    (d1, t1), (d2, t2) = gap(s), gap(s, "object_another", "goal_another")
    failed = (s["object_pos"][:, 2] <= 0.2) | (s["object_another_pos"][:, 2] <= 0.2)
    return np.exp(-0.2 * (50 * d1 + t1)) + np.exp(-0.2 * (50 * d2 + t2)), failed, d1 + d2 < 0.06


def re_orientation(s):
    (d1, t1), (d2, t2) = gap(s), gap(s, "object_another", "goal_another")
    hit = (t1 < 0.1) | (t2 < 0.1)  # ours: the original overwrites its test of the first cube
    failed = (s["object_pos"][:, 2] <= 0.2) | (s["object_another_pos"][:, 2] <= 0.2)
    effort = (s["actions"] ** 2).sum(axis=-1)
    reward = -10 * d1 - 10 * d2 + 1 / (t1 + 0.1) + 1 / (t2 + 0.1) - 0.0002 * effort + 500 * hit
    return reward, failed, hit


def lift(s):
    right, left = (norm(s[f"pot_{side}_handle_pos"] - s[f"{side}_hand_pos"]) for side in ("right", "left"))
    d = norm(s["goal_pos"] - s["object_pos"])
    up = np.where((right < 0.08) & (left < 0.08), 3 * (0.385 - d), 0)
    return 0.2 - right - left + up, (s["object_pos"][:, 2] <= 0.3) | (right >= 0.2) | (left >= 0.2), d < 0.05


def reaches(s, right: str, left: str) -> tuple[Array, Array]:
    return fingers(s, "right", s[right]), fingers(s, "left", s[left])


def door(base: float, bound: float, opens: bool):
    def judge(s):
        right, left = reaches(s, "door_right_handle_pos", "door_left_handle_pos")
        apart = np.abs(s["door_right_handle_pos"][:, 1] - s["door_left_handle_pos"][:, 1])
        bonus = np.where((right < 0.5) & (left < 0.5), 2 * apart if opens else 1 - 2 * apart, 0)
        success = apart > 0.5 if opens else apart < 0.5
        return base - right - left + bonus, (right >= bound) | (left >= bound), success

    return judge


def bottle(s):
    right = fingers(s, "right", s["bottle_cap_pos"])
    palm, left = norm(s["bottle_cap_pos"] - s["right_hand_pos"]), norm(s["bottle_pos"] - s["left_hand_pos"])
    lifted = norm(s["bottle_cap_up"] - s["bottle_pos"])
    failed = (s["bottle_cap_pos"][:, 2] <= 0.5) | (palm >= 0.5) | (left >= 0.2)
    return 2 - right - left + np.where(right <= 0.3, 30 * lifted, 0), failed, lifted > 0.03


def push(s):
    right, left = reaches(s, "block_right_handle_pos", "block_left_handle_pos")
    right_away = norm(s["right_goal_pos"] - s["block_right_handle_pos"])  # ours: the original uses the left goal twice
    left_away = norm(s["left_goal_pos"] - s["block_left_handle_pos"])
    success = np.where(left_away < 0.1, np.where(right_away < 0.1, 1.0, 0.5), 0.0)
    reward = (1.2 - right) + (1.2 - left) + 5 - 5 * left_away - 5 * right_away
    return reward, (right >= 1.2) | (left >= 1.2), success


def swing(s):
    right, left = reaches(s, "cup_right_handle_pos", "cup_left_handle_pos")
    theta = angle_between(s["object_rot"], s["goal_rot"])
    bonus = np.where((right < 0.4) & (left < 0.4), 1 / (theta + 0.1) - 1, 0)
    return -right - left + bonus, s["object_pos"][:, 2] <= 0.3, theta < 0.785


def grasp(s):
    right, left = reaches(s, "block_right_handle_pos", "block_left_handle_pos")
    apart = norm(s["block_right_handle_pos"] - s["block_left_handle_pos"])
    reward = np.exp(-10 * right) + np.exp(-10 * left) + 2 * np.exp(-10 * apart)
    return reward, (right >= 1.5) | (left >= 1.5), apart < 0.2


def stack(s):
    right, left = reaches(s, "block_right_handle_pos", "block_left_handle_pos")
    upper = norm(s["goal_pos"] + (0, -0.1, 0.05) - s["block_left_handle_pos"])
    lower = norm(s["goal_pos"] + (0, -0.1, 0) - s["block_right_handle_pos"])
    level = np.abs(0.675 - s["block_left_handle_pos"][:, 2])
    there = (upper < 0.07) & (lower < 0.07)
    up = np.where((right < 0.5) & (left < 0.5), 2 * (0.24 - upper - lower), 0)
    reward = 1.5 - right - left + up + np.where(there, 50 * (0.05 - level), 0)
    return reward, (right >= 0.75) | (left >= 0.75), there & (level < 0.03)


def scissors(s):
    right, left = reaches(s, "scissors_right_handle_pos", "scissors_left_handle_pos")
    q = s["scissors_hinge"]  # from the simulator: rewards do not see it
    up = np.where((right < 0.7) & (left < 0.7), 5 * (0.59 + q), 0)
    return 2 + up - right - left, (up < -0.5) | (right >= 1.75) | (left >= 1.75), q > -0.3


def switch(s):
    right, left = reaches(s, "switch_right_handle_pos", "switch_left_handle_pos")
    sunk = 1.4 - (s["switch_right_handle_pos"][:, 2] + s["switch_left_handle_pos"][:, 2])
    return 2 - right - left + 50 * sunk, np.zeros(len(sunk), bool), sunk > 0.012  # ours: 0.05 cannot be reached


def pen(s):
    right, left = reaches(s, "pen_right_handle_pos", "pen_left_handle_pos")
    apart = norm(s["pen_right_handle_pos"] - s["pen_left_handle_pos"])
    up = np.where((right < 0.75) & (left < 0.75), 5 * apart - 0.8, 0)
    return np.exp(-10 * right) + np.exp(-10 * left) + up, (right >= 1.5) | (left >= 1.5), 5 * apart > 1.5


def kettle(s):
    right, left = reaches(s, "kettle_handle_pos", "bucket_handle_pos")
    apart = norm(s["bucket_handle_pos"] - s["kettle_spout_pos"])
    up = np.where((right < 0.7) & (left < 0.7), 0.5 - 2 * apart, 0)
    return 1 - right - left + up, s["bucket_handle_pos"][:, 2] <= 0.2, apart < 0.05


# --- states on either side of every bound: f is a little below or above 1 ---


def moved(point: Array, *offset: float) -> Array:
    return point + np.array(offset)


def at_height(point: Array, z: float) -> Array:
    return np.concatenate((point[:, :2], np.full((len(point), 1), z)), axis=1)


def turned_by(s, angle: float, thing: str = "object", goal: str = "goal") -> dict[str, Array]:
    rot = mul(np.tile(about((0, 0, 1), angle), (len(s[f"{goal}_rot"]), 1)), s[f"{goal}_rot"])
    name = goal.replace("goal", "rotation_distance")
    return {f"{thing}_rot": rot, name: np.full(len(rot), angle)}


def catch_edges(floor: float):
    return lambda s, f: [
        {"object_pos": moved(s["goal_pos"], 0.03 * f, 0, 0)}, {"object_pos": at_height(s["goal_pos"], floor * f)}
    ]  # fmt: skip


def over2underarm_edges(s, f):
    here = np.zeros_like(s["goal_pos"])
    bases = [
        {"right_base_pos": moved(here, 0.1 * f, 0, 0.5)},
        {"left_base_pos": moved(here, 0, 0.1 * f - 0.8, 0.5)},
    ]
    return [*catch_edges(0.3)(s, f), *bases]


def abreast_edges(s, f):
    here = {side: turn(s[f"{side}_hand_rot"], np.tile((0, -0.02, 0.08), (len(s["goal_pos"]), 1))) for side in
            ("right", "left")}  # fmt: skip
    home = {"right": np.array((-0.3, -0.55, 0.5)), "left": np.array((-0.3, -1.15, 0.5))}
    still = {f"{side}_hand_pos": home[side] + here[side] for side in here}
    strays = [{**still, f"{side}_hand_pos": home[side] + here[side] + (0, 0.1 * f, 0)} for side in here]
    return [*({**still, **edge} for edge in catch_edges(0.2)(s, f)), *strays]


def pair_edges(s, f):
    there = {"object_pos": s["goal_pos"], "object_another_pos": s["goal_another_pos"]}
    gaps = {name: moved(point, 0, 0.03 * f, 0) for name, point in there.items()}
    drops = [{**there, name: at_height(point, 0.2 * f)} for name, point in there.items()]
    turns = [turned_by(s, 0.1 * f), turned_by(s, 0.1 * f, "object_another", "goal_another")]
    apart = {**turned_by(s, 1.0), **turned_by(s, 1.0, "object_another", "goal_another")}
    return [gaps, *drops, *({**apart, **turn} for turn in turns)]


def lift_edges(s, f):
    return [{"object_pos": moved(s["goal_pos"], 0, 0, -0.05 * f)}, {"object_pos": at_height(s["goal_pos"], 0.3 * f)}]


def scissors_edges(s, f):
    found = []
    for q in (-0.3 * f, -0.69 * f):
        rot = mul(s["scissors_left_handle_rot"], np.tile(about((0, 1, 0), q), (len(s["goal_pos"]), 1)))
        found.append({"scissors_right_handle_rot": rot, "scissors_hinge": np.full(len(rot), q)})
    return found


def stack_edges(s, f):
    lower, upper = s["goal_pos"] + (0, -0.1, 0), s["goal_pos"] + (0, -0.1, 0.05)
    there = {"block_right_handle_pos": lower, "block_left_handle_pos": upper}
    shifts = [{name: moved(point, 0.07 * f, 0, 0)} for name, point in there.items()]
    return [{**there, **shift} for shift in [*shifts, {"block_left_handle_pos": moved(upper, 0, 0, 0.03 * f)}]]


def push_edges(s, f):
    there = {f"block_{side}_handle_pos": s[f"{side}_goal_pos"] for side in ("right", "left")}
    return [{**there, name: moved(point, 0.1 * f, 0, 0)} for name, point in there.items()]


def apart(one: str, other: str, bound: float):
    return lambda s, f: [{one: moved(s[other], 0, bound * f, 0)}]


def bottle_edges(s, f):
    return [
        {"bottle_cap_up": moved(s["bottle_pos"], 0, 0.03 * f, 0)},
        {"bottle_cap_pos": at_height(s["bottle_cap_pos"], 0.5 * f)},
    ]


def swing_edges(s, f):
    return [turned_by(s, 0.785 * f), {"object_pos": at_height(s["object_pos"], 0.3 * f)}]


def switch_edges(s, f):
    names = ("switch_right_handle_pos", "switch_left_handle_pos")
    return [{name: at_height(s[name], 0.7 - 0.006 * f) for name in names}]


def kettle_edges(s, f):
    spout = s["kettle_spout_pos"]
    drop = {"bucket_handle_pos": at_height(s["bucket_handle_pos"], 0.2 * f)}
    return [{"bucket_handle_pos": moved(spout, 0, 0.05 * f, 0)}, drop]


EDGES: Mapping[str, Callable[[Mapping[str, Array], float], list[dict[str, Array]]]] = {
    "shadow_hand_over": catch_edges(0.2),
    "shadow_hand_catch_underarm": catch_edges(0.1),
    "shadow_hand_catch_over2underarm": over2underarm_edges,
    "shadow_hand_catch_abreast": abreast_edges,
    "shadow_hand_two_catch_underarm": pair_edges,
    "shadow_hand_re_orientation": pair_edges,
    "shadow_hand_lift_underarm": lift_edges,
    "shadow_hand_bottle_cap": bottle_edges,
    "shadow_hand_push_block": push_edges,
    "shadow_hand_swing_cup": swing_edges,
    "shadow_hand_grasp_and_place": apart("block_left_handle_pos", "block_right_handle_pos", 0.2),
    "shadow_hand_block_stack": stack_edges,
    "shadow_hand_scissors": scissors_edges,
    "shadow_hand_switch": switch_edges,
    "shadow_hand_pen": apart("pen_left_handle_pos", "pen_right_handle_pos", 0.3),
    "shadow_hand_kettle": kettle_edges,
    **{
        f"shadow_hand_door_{kind}": apart("door_left_handle_pos", "door_right_handle_pos", 0.5)
        for kind in ("open_inward", "open_outward", "close_inward", "close_outward")
    },
}
# Sums of finger distances (of palms in LiftUnderarm and for the bottle) at which a reward term or the end of the
# episode sets in.
REACHES: Mapping[str, tuple[float, ...]] = {
    "shadow_hand_lift_underarm": (0.08, 0.2), "shadow_hand_door_open_inward": (0.5, 1.5),
    "shadow_hand_door_open_outward": (0.5, 1.5), "shadow_hand_door_close_inward": (0.5, 1.5),
    "shadow_hand_door_close_outward": (0.5, 3.0), "shadow_hand_bottle_cap": (0.2, 0.3, 0.5),
    "shadow_hand_push_block": (1.2,), "shadow_hand_swing_cup": (0.4,), "shadow_hand_grasp_and_place": (1.5,),
    "shadow_hand_block_stack": (0.5, 0.75), "shadow_hand_scissors": (0.7, 1.75), "shadow_hand_pen": (0.75, 1.5),
    "shadow_hand_kettle": (0.7,),
}  # fmt: skip


# --- the tasks ---

AHEAD = (((0, 0, 0.5), (0, 0, 0)), ((0, -1.15, 0.5), (0, 0, pi)))
SIDEWAYS = (((0.55, 0.2, 0.6), (pi, 1.57, 1.57)), ((0.55, -0.2, 0.6), (pi, -1.57, 1.57)))
DOWN = (((0.55, 0.2, 0.8), (pi, 0, 1.57)), ((0.55, -0.2, 0.8), (pi, 0, 1.57)))
CUBE = (pi / 2, pi / 2, 0.0)
CUBE_ROT = np.array([0.5, 0.5, -0.5, 0.5])
QUARTER = np.array([0, 0, 0.5**0.5, 0.5**0.5])  # a quarter turn about z
TOWARDS = ("towards object goal",)
EGG = {"things": {"object": "egg"}, "palms": False, "fingers": (), "point": "base", "extras": TOWARDS}
PAIR_EXTRAS = ("towards object goal", "thing object_another", "towards object_another goal_another")
PAIR = {"palms": False, "fingers": (), "point": "base", "extras": PAIR_EXTRAS, "noise": True, "position_noise": 0.01,
        "posed_goals": ("goal", "goal_another"), "exposed": ("object", "object_another")}  # fmt: skip
BLOCKS = {"block_right_handle": (52, (0, 0, 0)), "block_left_handle": (53, (0, 0, 0))}


def doors(judge, *, inward: bool, angle: float = 0.0, x: float = 0.55, y: float = 0.2, goal: float = 10.7) -> Original:
    side = 1 if inward else -1
    rot = np.array([0, 1.0, 0, 0]) if inward else UPRIGHT
    return Original(
        250, 417, {"object": "door"}, {"object": ((0, 0, 0.7), (0, pi if inward else 0, 0))},
        {"goal": ((0, 0, goal), rot)},
        (((x, y, 0.6), (pi, 1.57, 1.57)), ((x, -y, 0.6), (pi, -1.57, 1.57))),
        ("door_left_handle_pos", "door_right_handle_pos"), judge,
        handles={"door_right_handle": (54, (0.39, -0.5, 0.04 * side)),
                 "door_left_handle": (55, (-0.39, -0.5, 0.04 * side))},
        ours=lambda s: {"handles_apart": np.abs(s["door_right_handle_pos"][:, 1] - s["door_left_handle_pos"][:, 1])},
    )  # fmt: skip


def handled(name: str) -> tuple[str, ...]:
    return f"{name}_right_handle_pos", f"{name}_left_handle_pos"


def parted(name: str) -> Callable[[Mapping[str, Array]], dict[str, Array]]:
    right, left = handled(name)
    return lambda s: {"handles_apart": norm(s[right] - s[left])}


# Ours: the start heights of things that the original puts inside a table or a palm.
ORIGINALS: Mapping[str, Original] = {
    "shadow_hand_over": Original(
        75, 398, starts={"object": ((0, -0.39, 0.555), None)}, goals={"goal": ((0, -0.64, 0.54), None)},
        hands=(AHEAD[0], ((0, -1, 0.5), (0, 0, pi))), judge=catch(50, 0.2), fixed=True, noise=True, position_noise=0.01,
        **EGG,
    ),
    "shadow_hand_catch_underarm": Original(
        75, 422, starts={"object": ((0, -0.39, 0.555), None)}, goals={"goal": ((0, -0.79, 0.54), None)},
        hands=AHEAD, judge=catch(50, 0.1), noise=True, position_noise=0.01, **EGG,
    ),
    "shadow_hand_catch_over2underarm": Original(
        75, 422, starts={"object": ((0, 0.05, 1.03), None)}, goals={"goal": ((0, -0.4, 0.55), None)},
        hands=(((0, 0, 0.5), (1.67, 3.14, 0)), ((0, -0.8, 0.5), (0, 0, pi))), judge=over2underarm, **EGG,
    ),
    "shadow_hand_catch_abreast": Original(
        150, 422, starts={"object": ((-0.39, -0.55, 0.545), None)}, goals={"goal": ((-0.39, -1.15, 0.54), None)},
        hands=(((0, -0.55, 0.5), (0, 0.3925, -1.57)), ((0, -1.15, 0.5), (0, -0.3925, -1.57))), judge=abreast,
        **{**EGG, "palms": True},
    ),
    "shadow_hand_two_catch_underarm": Original(
        75, 446, {"object": "egg", "object_another": "egg"},
        {"object": ((0, -0.39, 0.555), None), "object_another": ((0, -0.78, 0.555), None)},
        {"goal": ((0, -0.79, 0.54), None), "goal_another": ((0, -0.38, 0.54), None)}, AHEAD, judge=two_catch, **PAIR,
    ),
    "shadow_hand_re_orientation": Original(
        600, 422, {"object": "cube", "object_another": "cube"},
        {"object": ((0, -0.39, 0.6), None), "object_another": ((0, -0.76, 0.6), None)},
        {"goal": ((0, -0.39, 0.56), None), "goal_another": ((0, -0.76, 0.56), None)}, AHEAD, judge=re_orientation,
        fixed=True, **PAIR,
    ),
    "shadow_hand_lift_underarm": Original(
        500, 417, {"object": "pot"}, {"object": ((0, -0.6, 0.465), (0, 0, 0))}, {"goal": ((0, -0.6, 0.85), UPRIGHT)},
        (((0, 0.05, 0.45), (0, 0, 0)), ((0, -1.25, 0.45), (0, 0, pi))), handled("pot"), lift,
        handles={"pot_right_handle": (52, (0, 0.15, 0.06)), "pot_left_handle": (52, (0, -0.15, 0.06))}, fingers=(),
    ),
    "shadow_hand_door_open_inward": doors(door(2, 1.5, opens=True), inward=True),
    "shadow_hand_door_open_outward": doors(door(2, 1.5, opens=True), inward=False, goal=5.7),
    "shadow_hand_door_close_inward": doors(door(2, 1.5, opens=False), inward=True, angle=1.57, x=0.9, y=0.5),
    "shadow_hand_door_close_outward": doors(door(6, 3, opens=False), inward=False, angle=1.57),
    "shadow_hand_bottle_cap": Original(
        125, 420, {"object": "bottle"}, {"object": ((0.0076, -0.6, 0.5065), (0, -0.7, 0))},
        {"goal": ((0, -0.6, 1.5), euler(0, -0.7, 0))},
        (((0, -1.05, 0.5), (0.5, pi, pi)), ((0, -0.25, 0.45), (0, 0.87, 0))),
        ("bottle_pos", "bottle_cap_pos", "bottle_cap_up"), bottle,
        handles={"bottle": (52, (0, 0, 0)), "bottle_cap": (52, (0, 0, 0.15)), "bottle_cap_up": (55, (0, 0, 0))},
        fingers=("right",),
    ),
    "shadow_hand_push_block": Original(
        125, 428, {"object": "cube", "block_left": "cube"},
        {"object": ((0, 0.2, 0.625), CUBE), "block_left": ((0, -0.2, 0.625), CUBE)},
        {"right_goal": ((-0.2, 0.2, 0.625), CUBE_ROT), "left_goal": ((-0.2, -0.2, 0.625), CUBE_ROT)}, DOWN,
        (*handled("block"), "left_goal_pos", "right_goal_pos"), push, handles=BLOCKS, posed_goals=(), padding=5,
        marker=((0, 0.2, 10.6), CUBE_ROT),
    ),
    "shadow_hand_swing_cup": Original(
        150, 417, {"object": "cup"}, {"object": ((0, 0, 0.685), (0, 0, pi / 2))},
        {"goal": ((0, 0, 1.6), about((0, 0, 1), 1.5 * pi))},
        (((0.35, 0.2, 0.8), (pi, 1.57, 1.57)), ((0.35, -0.2, 0.8), (pi, -1.57, 1.57))), handled("cup"), swing,
        handles={"cup_right_handle": (52, (0.062, 0, 0)), "cup_left_handle": (53, (0, 0, 0.06))},
    ),
    "shadow_hand_grasp_and_place": Original(
        500, 425, {"object": "bucket", "block": "cube"},
        {"object": ((0, 0.2, 0.653), (0, 0, 0)), "block": ((0, -0.2, 0.625), CUBE)},
        {"goal": ((-0.3, 0, 0.6), UPRIGHT)},
        DOWN, ("block_right_handle_pos", "block_right_handle_rot", "block_left_handle_pos", "block_left_handle_rot"),
        grasp, handles={"block_right_handle": (53, (0, 0, 0)), "block_left_handle": (54, (0, 0, 0))}, posed_goals=(),
        marker=((0, 0.2, 10.6), UPRIGHT),
    ),
    "shadow_hand_block_stack": Original(
        250, 428, {"object": "cube", "block": "cube"},
        {"object": ((0, 0.1, 0.625), CUBE), "block": ((0, -0.1, 0.625), CUBE)}, {"goal": ((0, 0.1, 0.625), CUBE_ROT)},
        (((0, 0.6, 0.7), (pi, 0, pi)), ((0, -0.6, 0.7), (pi, 0, 0))), ("thing block",), stack, handles=BLOCKS,
        exposed=("object", "block"), padding=4,
        ours=lambda s: {"right_goal_pos": moved(s["goal_pos"], 0, -0.1, 0),
                        "left_goal_pos": moved(s["goal_pos"], 0, -0.1, 0.05)},
    ),
    "shadow_hand_scissors": Original(
        150, 417, {"object": "scissors"}, {"object": ((0, 0, 0.608), (0, 0, pi / 2))},
        {"goal": ((0, 0, 10.6), QUARTER)},
        DOWN, handled("scissors"), scissors,
        handles={"scissors_right_handle": (54, (0.2, 0, -0.1)), "scissors_left_handle": (53, (0.15, 0, 0.1))},
        ours=parted("scissors"),
    ),
    "shadow_hand_switch": Original(
        125, 417, {"object": "right_switch", "switch_left": "left_switch"},
        {"object": ((0, 0.2, 0.65), (pi, pi / 2, 0)), "switch_left": ((0, -0.2, 0.65), (pi, pi / 2, 0))},
        {"goal": ((0, 0.2, 10.65), euler(pi, pi / 2, 0))}, DOWN, handled("switch"), switch,
        handles={"switch_right_handle": (54, (-0.05, -0.02, 0)), "switch_left_handle": (57, (-0.05, -0.02, 0))},
    ),
    "shadow_hand_pen": Original(
        125, 417, {"object": "pen"}, {"object": ((0, 0, 0.612), CUBE)}, {"goal": ((0, 0, 10.6), CUBE_ROT)}, DOWN,
        handled("pen"), pen,
        handles={"pen_right_handle": (54, (0, -0.1, 0)), "pen_left_handle": (53, (0, 0.07, 0))},
        ours=parted("pen"),
    ),
    "shadow_hand_kettle": Original(
        125, 417, {"object": "kettle", "bucket": "bucket"},
        {"object": ((0, 0, 0.474), (0, 0, pi / 2)), "bucket": ((0, -0.3, 0.453), (0, 0, 0))},
        {"goal": ((0, 0, 10.5), QUARTER)}, SIDEWAYS, ("kettle_handle_pos", "bucket_handle_pos"), kettle,
        handles={"kettle_handle": (52, (0.15, 0, 0)), "kettle_spout": (52, (-0.2, 0, 0.07)),
                 "bucket_handle": (55, (0, 0, -0.1))},
        exposed=("object", "bucket"),  # ours: the original shows the bucket in root_state_tensor alone
    ),
}  # fmt: skip
