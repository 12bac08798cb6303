"""The child process behind `report.video`: plays a policy in one world and encodes what the camera sees.

The parent sets MUJOCO_GL, which MuJoCo reads when it is imported.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np

from ..errors import EurekaError
from ..tasks.faults import fault, told
from ..worker import Channel
from .screen import Screen, draws_itself
from .stage import Stage

WIDTH, HEIGHT = 640, 480
FPS = 30


def frames(stage: Stage | Screen, seconds: float) -> Iterator[np.ndarray]:
    """(HEIGHT, WIDTH, 3) uint8 images, FPS a second of simulated time."""
    with stage.painter(WIDTH, HEIGHT) as paint:
        count = 0
        for step in range(max(1, round(seconds / stage.dt))):
            if step * stage.dt * FPS >= count:
                yield paint()
                count += 1
            stage.step()


def encode(images: Iterator[np.ndarray]) -> bytes:
    """An mp4 (H.264) of the images; ffmpeg comes with the imageio-ffmpeg wheel."""
    import imageio_ffmpeg  # here, where its absence is not taken for that of OpenGL

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "video.mp4"
        writer = imageio_ffmpeg.write_frames(str(path), (WIDTH, HEIGHT), fps=FPS, quality=7, macro_block_size=1)
        writer.send(None)
        for image in images:
            writer.send(np.ascontiguousarray(image))
        writer.close()
        return path.read_bytes()


def _try_renderer() -> None:
    """Renders one empty scene; dies where there is no OpenGL."""
    with mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 16, 16) as renderer:
        renderer.render()


def main() -> None:
    channel = Channel()
    request = channel.receive()
    if request is None:
        return
    _try_renderer()
    channel.send({})  # from here on, nothing that goes wrong is for want of OpenGL
    wanted = request.header
    if wanted["agent"] == "none":
        return
    try:
        agent = request.blobs.get("policy", wanted["agent"])
        shown = Screen if draws_itself(wanted["env"]) else Stage
        video = encode(frames(shown(wanted["env"], agent, wanted["seed"]), wanted["seconds"]))
    except EurekaError as error:
        channel.send({"refused": str(error)})
    except Exception as error:
        channel.send({"refused": str(fault(error) or f"The video could not be made: {told(error)}")})
    else:
        channel.send({}, {"video": video})


if __name__ == "__main__":
    main()
