"""The child process behind `film.video`: plays policies, each in one world, and encodes what the cameras see.

The parent sets MUJOCO_GL, which MuJoCo reads when it is imported.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..errors import EurekaError, told
from ..opengl import missing, mujoco
from ..tasks.faults import fault
from ..worker import Channel
from . import mp4
from .stage import Screen, Stage, draws_itself

WIDTH, HEIGHT = 1280, 720
FPS = 30
ROUNDING = 1e-6
"""[pictures] of rounding error that a sum of steps may have."""


def frames(stages: Sequence[Stage | Screen], seconds: float, captions: Sequence[str] = ()) -> Iterator[np.ndarray]:
    """(HEIGHT, WIDTH, 3) uint8 images, FPS a second of simulated time: several worlds side by side, each with its
    caption."""
    width = WIDTH // len(stages)
    with ExitStack() as opened:
        painters = [opened.enter_context(stage.painter(width, HEIGHT)) for stage in stages]
        labels = [_label(text) for text in captions]
        count = 0
        for step in range(max(1, round(seconds / stages[0].dt))):
            due = (step + 1) * stages[0].dt * FPS - ROUNDING  # at the end of the step, which may last several pictures
            if count < due:
                pictures = [paint() for paint in painters]
                for picture, label in zip(pictures, labels, strict=False):
                    _stick(label, picture)
                whole = np.concatenate(pictures, axis=1)
                while count < due:
                    yield whole
                    count += 1
            for stage in stages:
                stage.step()


def _label(text: str) -> np.ndarray:
    """(h, w) brightness of a line of text on a dark background."""
    font = ImageFont.load_default(26)
    left, top, right, bottom = font.getbbox(text)
    picture = Image.new("L", (round(right - left) + 28, round(bottom - top) + 24), 32)
    ImageDraw.Draw(picture).text((14 - left, 12 - top), text, 255, font)
    return np.asarray(picture)


def _stick(label: np.ndarray, picture: np.ndarray) -> None:
    """Put a label into the upper left corner of a picture."""
    part = picture[16 : 16 + label.shape[0], 16 : 16 + label.shape[1]]
    part[:] = label[: part.shape[0], : part.shape[1], None]


def _shown(env: str, agent: str | bytes, seed: int, beside: int) -> Stage | Screen:
    """One of several worlds that share a picture."""
    return Screen(env, agent, seed) if draws_itself(env) else Stage(env, agent, seed, WIDTH / beside / HEIGHT)


def _try_renderer() -> None:
    """Renders one empty scene; dies where there is no OpenGL."""
    if missing:
        raise RuntimeError(missing)
    with mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 16, 16) as renderer:
        renderer.render()


def main() -> None:
    channel = Channel()
    request = channel.receive()
    if request is None:
        return
    _try_renderer()
    channel.send({})  # tells the parent that OpenGL works: whatever fails later has another cause
    wanted = request.header
    if not wanted["agents"]:
        return
    try:
        agents = [request.blobs.get(f"policy {place}", agent) for place, agent in enumerate(wanted["agents"])]
        stages = [_shown(wanted["env"], agent, wanted["seed"], len(agents)) for agent in agents]
        video = mp4.encode(frames(stages, wanted["seconds"], wanted["captions"]), FPS)
    except EurekaError as error:
        channel.send({"refused": str(error)})
    except Exception as error:
        channel.send({"refused": str(fault(error) or f"The video could not be made: {told(error)}")})
    else:
        channel.send({}, {"video": video})


if __name__ == "__main__":
    main()
