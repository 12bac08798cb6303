"""The Shadow Hand (right): 24 joints, 20 position drives, read as data from the installed gymnasium-robotics wheel."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco

from .assets import wheel_file

FINGERS = ("ff", "mf", "rf", "lf", "th")
FINGERTIPS = tuple(f"{finger}distal" for finger in FINGERS)
"""Bodies whose frames are at the last joint of each finger, not at its tip."""
COUPLINGS = ("T_FFJ1c", "T_MFJ1c", "T_RFJ1c", "T_LFJ1c")
"""Tendons that make a finger's last joint follow the one before it, within 0.14 rad."""

_SHAPELESS = ("V_thbase", "V_thhub")  # placeholders that collide by accident


def add_shadow_hand(
    scene: mujoco.MjSpec,
    prefix: str,
    *,
    pos: Sequence[float] = (0.0, 0.0, 0.0),
    quat: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
) -> mujoco.MjsBody:
    """Attach one hand to a scene and return its root, the forearm's mount: fixed, unless a joint is added to it.

    With no rotation the fingers point along -y and the palm faces up, 0.29 m from the mount. Names are those of the
    wheel's file with `prefix`, which must not be empty, in place of `robot0:` (bodies `palm`, `ffdistal`, joints
    `FFJ3`, drives `A_FFJ3`, collision geoms `C_palm0`). Bodies, joints and drives come in the file's order, and the
    scene keeps its own options.

    Unlike in the file, but as in the originals, there is no gravity on the hand, and no tendon except the couplings.
    Also left out are the margin of the joint limits, and friction in the joints (0.001 N m), which costs a constraint
    row each.

    Args:
        pos: position of the mount in the world [m].
        quat: rotation of the whole hand about the mount, w x y z.

    Raises:
        TaskError: when the wheel's files are missing.
    """
    hand = _load()
    hand.option = scene.option
    mount = hand.body("hand mount")
    mount.pos = [0, 0, 0]
    for body in hand.bodies:
        if body is not hand.worldbody:
            body.gravcomp = 1
    for joint in hand.joints:
        joint.frictionloss, joint.margin = 0, 0
    for name in _SHAPELESS:
        geom = hand.geom(name)
        geom.contype, geom.conaffinity = 0, 0
    for extra in (*hand.sensors, *(tendon for tendon in hand.tendons if tendon.name not in COUPLINGS)):
        hand.delete(extra)
    return scene.worldbody.add_frame(pos=pos, quat=quat).attach_body(mount, prefix, "")


def _load() -> mujoco.MjSpec:
    """The wheel's scene with plain names, without the sky and the sizes that would clash with the scene's own."""
    scene = wheel_file("gymnasium_robotics", "envs/assets/hand/reach.xml")
    parts = ("shared.xml", "shared_asset.xml", "robot.xml")
    include = {part: (scene.parent / part).read_text().replace("robot0:", "").encode() for part in parts}
    spec = mujoco.MjSpec.from_string(scene.read_text(), include=include)
    spec.delete(next(texture for texture in spec.textures if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX))
    for mesh in spec.meshes:
        mesh.file = str(scene.parent.parent / "stls" / "hand" / mesh.file)
    for size in ("njmax", "nconmax", "nuser_jnt", "nuser_site", "nuser_tendon", "nuser_actuator", "nuser_sensor"):
        setattr(spec, size, -1)
    return spec
