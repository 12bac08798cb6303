"""Drafts a task file from a MuJoCo model.

What the robot is to do is guessed (`aim.py`), and the file says so at the place where a person may write something
else. A sentence that is not understood gives no F: such a draft says what to write, and can be watched but not trained.
"""

from __future__ import annotations

import keyword
import os
import re
import shlex
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from ..errors import TaskError
from ..tasks.anatomy import named
from ..tasks.start import SWAY, at_start, sway
from ..tasks.task import INTEGRATOR
from ..tasks.urdf import read_urdf
from ..text import nameable
from .aim import Aim, find_aim
from .controls import controls
from .source import columns, declared, number, quoted, template, tuple_of
from .survey import Survey
from .table import FIELDS, StateTable, Variable

CONTROL_DT = 0.02
"""[s] between two actions, or the model's own timestep if that is longer."""
SECONDS = 10.0
"""[s] of an episode."""
EXCESS = 200.0
"""[m^2/s^2] An effort of more than this per kg of robot, 20 times its weight at 1 m, is taken for a placeholder."""
ABOVE = 1.25
"""A goal that is lower than this many times the height of a fall asks the robot to be low: then a fall ends no episode.

Both count from the ground."""


@dataclass(frozen=True, slots=True)
class Draft:
    """A task file, and the guess in it."""

    text: str
    aim: Aim
    said: bool
    """Whether a person gave a sentence or names to guess the aim from."""
    guessed: tuple[str, ...] = ()
    """Actuators whose ranges are guessed, as the model gives none."""
    excess: str = ""
    """For a URDF whose effort limits are out of all proportion to its mass: both in words."""

    @property
    def line(self) -> int:
        """The number of the line where F is computed."""
        return 1 + self.text[: self.text.index("def sparse_reward")].count("\n")


def draft(
    path: Path, robot: Path, intent: str = "", *, thing: str = "", goal: str = "", floating: bool = False
) -> Draft:
    """A task file.

    Args:
        path: where it will be; its name names the class.
        robot: the model, MJCF or URDF.
        intent: the sentence that a language model will read; empty takes the sentence of the guess.
        thing: the body, site or geom to bring to another one, `goal`; either may be empty for a guess.
        floating: for a URDF, whether its root moves freely.

    Raises:
        TaskError: when MuJoCo cannot read the model, nothing moves it, or it has no such thing or goal.
    """
    urdf = _is_urdf(robot)
    if floating and not urdf:
        raise TaskError("`floating` is only for a URDF; in a MuJoCo model, add <freejoint/> to the root body.")
    model = _read(robot, urdf, floating)
    survey = Survey(model)
    aim = find_aim(survey, intent, names=(path.stem, robot.stem), thing=thing, goal=goal)
    table = StateTable(survey)
    variables = list(table.variables(aim.mover, aim.hand))
    wanted = table.value(aim.goal) if aim.goal else "self.goal_pos.clone()"
    fallen = _fallen(survey, aim)
    timestep = float(model.opt.timestep)
    substeps = max(1, round(CONTROL_DT / timestep))
    inputs = controls(model)
    guessed = tuple(named(model, "ACTUATOR", index) for index, control in enumerate(inputs) if control.guessed)
    values = [variable.value for variable in variables]
    goal_size = 3 if aim.goal or aim.point else 0
    text = template("task.py.jinja").render(
        name=class_name(path),
        env=path.stem,
        path=path,
        word=shlex.quote(f"env={path}"),
        robot=robot,
        place=_place(path, robot),
        urdf=urdf,
        floating=floating,
        description=(" ".join(intent.split()).rstrip(". ") or aim.description).replace('"', "'").replace("\\", "/"),
        aim=aim,
        survey=survey,
        fallen=fallen,
        base=survey.root.name if survey.root else "",
        mover=table.variable(aim.mover) if aim.mover else "",
        hand=table.variable(aim.hand) if aim.hand else "",
        goal=wanted,
        example=next(variable.name for variable in variables if variable.use == "point" or not variable.size),
        variables=[(variable.name, _declared(variable), variable.value) for variable in variables],
        observed=[_observed(variable) for variable in variables if variable.seen],
        observations=sum(len(variable.seen) for variable in variables) + goal_size,
        joints=tuple_of([quoted(joint) for joint in table.joints]),
        found=table.lines,
        read=[field for field in FIELDS if any(f"self.{field}[" in text for text in (wanted, *values))],
        placed=_placed(model),
        controls=tuple_of([f"({number(low)}, {number(high)})" for low, high, _ in inputs]),
        guessed=guessed,
        sways=bool(sway(model).any()),
        sway=SWAY,
        substeps=substeps,
        control_dt=number(substeps * timestep),
        episode=max(2, round(SECONDS / (substeps * timestep))),
        model=model,
    )
    return Draft(text, aim, bool(intent.strip() or thing or goal), guessed, _excess(model) if urdf else "")


def _excess(model: mujoco.MjModel) -> str:
    """The largest effort of a model from a URDF and its mass, where the effort lifts far more than that at 1 m."""
    efforts = np.where(model.actuator_forcelimited, model.actuator_forcerange[:, 1], model.actuator_gear[:, 0])
    effort, mass = float(efforts.max()), float(model.body_mass.sum())
    return f"the largest effort is {effort:g} for a robot of {mass:.2g} kg" if effort > EXCESS * mass else ""


def class_name(path: Path) -> str:
    """`my_robot.py` holds the class MyRobot."""
    name = "".join(part.capitalize() for part in nameable(path.stem).replace("_", " ").split())
    return name if name.isidentifier() and not keyword.iskeyword(name) else f"Task{name}"


def _is_urdf(robot: Path) -> bool:
    if not robot.is_file():
        raise TaskError(f"There is no file {robot}; name a MuJoCo XML file or a URDF, for example model=hopper.xml.")
    if robot.suffix.lower() == ".xacro":
        raise TaskError(f"{robot} is not a URDF yet; run `xacro {robot} > robot.urdf`, and use model=robot.urdf.")
    text = robot.read_text(encoding="utf-8", errors="replace")
    return robot.suffix.lower() == ".urdf" or "<robot" in re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)[:4096]


def _read(robot: Path, urdf: bool, floating: bool) -> mujoco.MjModel:
    mujoco.set_mju_user_warning(lambda _: None)  # its own handler would write a log file into the working directory
    try:
        spec = read_urdf(robot, floating=floating) if urdf else mujoco.MjSpec.from_file(str(robot))
        spec.option.integrator = INTEGRATOR
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        said = " ".join(str(error).split())
        if "could not find decoder" in said:
            said = f"the name of a model must end in .xml; rename it to {robot.with_suffix('.xml').name}"
        raise TaskError(f"MuJoCo cannot read {robot}: {said}.") from None
    if not model.nu:
        raise TaskError(f"{robot} has no actuators, so nothing can move it; add some to the model.")
    return model


def _declared(variable: Variable) -> str:
    kind = "f" if "{" in variable.meaning else ""
    shape = (variable.size,) if variable.size else ()
    return declared(variable.name, f'{kind}"{variable.meaning}"', shape, variable.use)


def _observed(variable: Variable) -> str:
    """Python for what the policy sees of it, (N, k)."""
    if not variable.size:
        return f's["{variable.name}"][:, None]'
    whole = len(variable.seen) == variable.size
    return f's["{variable.name}"]' + ("" if whole else f"[:, {columns(variable.seen)}]")


def _fallen(survey: Survey, aim: Aim) -> str:
    """[m] z of the base below which an episode ends; empty where there is no F, or the robot's goal is that low."""
    fallen = survey.fallen
    if fallen is None or aim.missing:
        return ""
    if aim.goal is not None and aim.mover is not None and survey.is_robots(aim.mover):
        low = survey.ground + ABOVE * (fallen - survey.ground)
        return "" if survey.where(aim.goal)[2] < low else str(fallen)
    return str(fallen)


def _placed(model: mujoco.MjModel) -> list[str]:
    """Fields of MjData besides `qpos` whose values in the first keyframe differ from those of the model as drawn."""
    drawn = mujoco.MjData(model)
    fields = ("qvel", "act", "mocap_pos", "mocap_quat")
    return [field for field in fields if not np.allclose(at_start(model, field), getattr(drawn, field))]


def _place(path: Path, robot: Path) -> str:
    """Python for the model's path: relative to the task file if the model is in its folder or below, else absolute."""
    folder, robot = path.resolve().parent, robot.resolve()
    if robot.is_relative_to(folder):
        return f"Path(__file__).parent / {quoted(os.path.relpath(robot, folder))}"
    return f"Path({quoted(str(robot))})"
