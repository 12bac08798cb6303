"""A policy as ONNX, and its files for a robot."""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import onnx
import torch
import yaml
from onnx import TensorProto, helper, numpy_helper

from ..errors import TaskError
from ..tasks.deployment import as_text, changed, described
from ..tasks.env import BatchedEnv
from ..tasks.task import Task
from ..training.network import EPSILON, LIMIT
from ..training.policy import Policy
from .sim2sim import Robot, Senses

OPSET = 17
"""Old enough for runtimes since 2022."""
PROGRAMS = ("policy.onnx", "deploy.yaml", "scene.xml", "sim2sim.py")
"""Files that `deployed` may make, besides those in `ASSETS`."""
ASSETS = "assets"


class NotRenewed(TaskError):
    """The files of a policy cannot be made from the task as it is here; the existing ones may still be right."""


def to_onnx(policy: Policy, about: Mapping[str, Any] | None = None) -> bytes:
    """The deterministic policy: `observation` (N, O) float32 to `action` (N, A) in [-1, 1].

    O counts what the policy sees: the task's observation without the columns in `observation_unseen`.

    For a task with C choices `action` is (N, C) int64: the index of the option of each choice. Inside the file are the
    task's clip of observations, their normalisation (x - mean) / sqrt(var + 1e-5) clamped at +-5, then ELU layers and a
    linear head.

    Args:
        about: the file's metadata on the task, as `described` gives it; lists are written with commas. Observations are
            clipped at its `observation_clip`, or not at all without one.

    Raises:
        RewardFileError: when the policy's tensors make no network.
    """
    policy.expect()
    known = {"env": policy.env, "observation_clip": math.inf, "observation_unseen": list(policy.unseen)}
    about = known | dict(about or {})
    clip = float(about["observation_clip"])
    tensors = {name: value.cpu().double().numpy() for name, value in policy.tensors.items()}
    count = policy.actions
    seen = [column for column in range(policy.observations) if column not in policy.unseen]
    tensors |= {"w0": tensors["w0"][seen]}
    constants = {
        "mean": tensors["observation_mean"][:, seen],
        "scale": 1.0 / np.sqrt(tensors["observation_var"][:, seen] + EPSILON),
        "low": np.array(-LIMIT),
        "high": np.array(LIMIT),
        "head_w": tensors["head_w"][:, :count],  # without the column of the value
        "head_b": tensors["head_b"][:, :count],
    }
    nodes, observed = list[onnx.NodeProto](), "observation"
    if math.isfinite(clip):
        constants |= {"least": np.array(-clip), "most": np.array(clip)}
        nodes, observed = [helper.make_node("Clip", ["observation", "least", "most"], ["clipped"])], "clipped"
    nodes += [
        helper.make_node("Sub", [observed, "mean"], ["centred"]),
        helper.make_node("Mul", ["centred", "scale"], ["scaled"]),
        helper.make_node("Clip", ["scaled", "low", "high"], ["x0"]),
    ]
    for layer in range(len(policy.hidden)):
        constants |= {name: tensors[name] for name in (f"w{layer}", f"b{layer}")}
        nodes += [
            helper.make_node("Gemm", [f"x{layer}", f"w{layer}", f"b{layer}"], [f"h{layer}"]),
            helper.make_node("Elu", [f"h{layer}"], [f"x{layer + 1}"]),
        ]
    nodes += [helper.make_node("Gemm", [f"x{len(policy.hidden)}", "head_w", "head_b"], ["head"])]
    if policy.choices:
        parts, picked = ([f"{name}{choice}" for choice in range(len(policy.choices))] for name in ("part", "picked"))
        constants["choices"] = np.array(policy.choices, np.int64)
        nodes += [
            helper.make_node("Split", ["head", "choices"], parts, axis=1),
            *(
                helper.make_node("ArgMax", [part], [index], axis=1, keepdims=1)
                for part, index in zip(parts, picked, strict=True)
            ),
            helper.make_node("Concat", picked, ["action"], axis=1),
        ]
        action = helper.make_tensor_value_info("action", TensorProto.INT64, ["N", len(policy.choices)])
    else:
        constants |= {"lowest": np.array(-1.0), "highest": np.array(1.0)}
        nodes += [helper.make_node("Clip", ["head", "lowest", "highest"], ["action"])]
        action = helper.make_tensor_value_info("action", TensorProto.FLOAT, ["N", count])
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, ["N", len(seen)])],
        [action],
        [
            numpy_helper.from_array(value.astype(np.float32) if value.dtype == np.float64 else value, name)
            for name, value in constants.items()
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], producer_name="openeureka")
    model.ir_version = 8  # the one that came with this opset
    helper.set_model_props(model, as_text(about))
    onnx.checker.check_model(model)
    return model.SerializeToString()


def deployed(policy: Policy, task: type[Task]) -> dict[str, bytes]:
    """The files that run the policy without openeureka, by name: policy.onnx and others.

    For a task without a `deployment` they are policy.onnx and deploy.yaml alone.

    Raises:
        RewardFileError: when the policy does not fit the task.
        NotRenewed: when the task has changed since the policy was trained, or its model lacks files.
        TaskError: when the task's `deployment` is not what the task observes and does.
    """
    if task.deployment is not None:
        policy.expect(task.num_observations, task.num_actions)
        try:
            task.compile_model()
        except TaskError as error:
            raise NotRenewed(str(error)) from None
    about = described(task, policy.unseen)
    if name := changed(policy.interface, as_text(about)):
        raise NotRenewed(
            f"`{name}` of `{task.env}` has changed since its policy was trained, so the files that deploy it were not "
            "renewed. Undo the change, or train again."
        )
    if task.deployment is None:
        head, others = (_ELSEWHERE if task.acting() else _NOT_SAID).format(env=task.env), {}
    else:
        _expect_same(task)
        program = files("openeureka.report").joinpath("sim2sim.py").read_bytes()
        head, others = _HEAD, {**_scene(task), "sim2sim.py": program}
    listed = yaml.safe_dump(about, sort_keys=False, default_flow_style=None, width=110)
    return {"policy.onnx": to_onnx(policy, about), "deploy.yaml": (head + listed).encode(), **others}


def _scene(task: type[Task]) -> dict[str, bytes]:
    """scene.xml, and in assets/ the meshes and pictures that it needs. Raises NotRenewed where one cannot be read."""
    spec = task.compiled()[0]
    root, given, found = ElementTree.fromstring(spec.to_xml()), spec.assets or {}, dict[str, bytes]()
    for part in root.iterfind("asset/*"):
        folder = spec.texturedir if part.tag == "texture" else spec.meshdir
        for key, file in part.attrib.items():
            if not key.startswith("file"):
                continue
            path = Path(spec.modelfiledir, folder, file)
            try:
                content = given[file] if file in given else path.read_bytes()
            except OSError as error:
                raise NotRenewed(
                    f"scene.xml of `{task.env}` needs {path}, which cannot be read: {error.strerror}."
                ) from None
            name = f"{ASSETS}/{len(found)}_{path.name}"
            found[name] = content
            part.set(key, name)
    for compiler in root.iterfind("compiler"):
        for key in ("meshdir", "texturedir"):
            compiler.attrib.pop(key, None)
    return {"scene.xml": ElementTree.tostring(root), **found}


def _expect_same(task: type[Task]) -> None:
    """Raises TaskError where sim2sim.py makes another observation than the task, or sets other targets. Commands, which
    only the task knows, are not compared."""
    env = BatchedEnv(task, worlds=4, threads=1)
    env.reset()
    actions = torch.rand(4, task.num_actions, generator=torch.Generator().manual_seed(0)) * 2.0 - 1.0
    step = env.step(actions)
    about = described(task)
    senses, names = Senses(as_text(about)), np.repeat(about["observation_names"], about["observation_sizes"])
    for world in (~step.done).nonzero().flatten().tolist():
        model, data = env.sim.snapshot(world)
        senses.action = actions[world].numpy().astype(float)
        seen = senses.observe(*Robot(model, data, senses.joints).state(), [0.0] * len(senses.commands))
        other = ~np.isclose(seen, step.observation[world].numpy(), rtol=1e-3, atol=1e-3) & (names != "commands")
        if other.any():
            raise TaskError(
                f"`{names[other][0]}` in the `deployment` of `{task.env}` does not match what `observe` gives; list "
                "the terms of `observe` in order, with their scales."
            )
        low, high = senses.low, senses.high
        if not np.allclose(senses.targets(), np.clip(data.ctrl, low, high), rtol=1e-3, atol=1e-3):
            raise TaskError(
                f"`apply_action` of `{task.env}` does not set default_pose + action_scale * action, as its "
                "`deployment` says; correct one of them."
            )


_COLUMNS = """# policy.onnx takes the observation in one row, without the columns in observation_unseen, counted from 0.
# The observation's clip and normalisation are inside it.
"""
_NOT_SAID = (
    """# `{env}` does not say what its observation consists of, so no other program can compute it: give the task's
# class a `deployment` (openeureka.tasks.deployment).
"""
    + _COLUMNS
)
_ELSEWHERE = (
    """# The observation is what `{env}` gives: its parts in order, discrete values one-hot. Actions of -1 to 1 are
# action_low to action_high there; the options of a discrete action are numbered from action_first on.
"""
    + _COLUMNS
)
_HEAD = """# How to run policy.onnx on a robot. Lists are in the order of actions or of the observation; units are SI.
# target angle = default_joint_pos + action_scale * action, kept from target_low to target_high; torque of the drive =
# joint_stiffness * (target - angle) - joint_damping * rate, at most torque_limit either way. The joint in simulation
# adds - passive_stiffness * (angle - passive_rest) - passive_damping * rate, dry friction of at most friction_loss, and
# armature to its inertia. The observation's terms, in order, times observation_scales, are clipped; normalisation is
# inside policy.onnx. sim2sim.py does all of it.
"""
