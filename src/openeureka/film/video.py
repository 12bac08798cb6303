"""Videos of policies without a display, rendered in a child so that a crash of a graphics driver stays there."""

from __future__ import annotations

import os

from ..errors import EurekaError, WorkerError
from ..worker import Frame, Worker, WorkerDied, WorkerTimeout

INSTALL = "install a software renderer (Debian, Ubuntu: apt-get install libegl1 libgl1-mesa-dri, or libosmesa6)"

START, BACKGROUND_START = 60.0, 600.0
"""[s] that the child may take to find out whether it can render. It needs some seconds of a core; in the background it
gets only what trainings leave."""
PATIENCE, SHORTEST = 60.0, 600.0
"""[s] that a second of film may take, for which a CPU alone needs ten or twenty; and that any film may take."""


class VideoUnavailable(EurekaError):
    """The policy cannot be shown."""


class NoRenderer(VideoUnavailable):
    """This machine cannot render at all."""


def render(
    env: str,
    policy: bytes | str,
    *,
    beside: bytes | str | None = None,
    captions: tuple[str, ...] = (),
    seconds: float = 10.0,
    seed: int = 0,
    timeout: float = 0.0,
    background: bool = False,
) -> bytes:
    """An mp4 of one world, 1280 x 720 pixels at 30 pictures a second.

    Args:
        policy: safetensors bytes of a trained policy, or `random` or `zero`.
        beside: another policy, in a world that begins alike, in the right half of the picture.
        captions: a text to write over each.
        seconds: length in simulated time.
        timeout: [s] for each way of rendering that is tried; 0 gives as long as a busy machine needs.
        background: use one thread of the lowest priority, and take the time that others leave.

    Raises:
        VideoUnavailable: with one sentence that says what to install.
    """
    agents = [agent for agent in (policy, beside) if agent is not None]
    names = [agent if isinstance(agent, str) else "policy" for agent in agents]
    request = {"env": env, "agents": names, "captions": captions, "seconds": seconds, "seed": seed}
    blobs = {f"policy {place}": agent for place, agent in enumerate(agents) if isinstance(agent, bytes)}
    patience = timeout or max(SHORTEST, seconds * PATIENCE)
    _, answer = _first_that_works(request, blobs, patience, background)
    return answer.blobs["video"]


def renderer() -> str:
    """Name of the rendering back end that works here. Raises VideoUnavailable."""
    backend, _ = _first_that_works({"agents": []}, {}, START)
    return backend


def _first_that_works(
    request: dict[str, object], blobs: dict[str, bytes], timeout: float, background: bool = False
) -> tuple[str, Frame]:
    """The first back end that can render here, and its child's answer."""
    reasons = []
    able = late = False
    patience = BACKGROUND_START if background else START
    manners = {"OMP_NUM_THREADS": "1", "LP_NUM_THREADS": "1"} if background else {}  # LP: Mesa's software renderer
    for backend in _backends():
        environment = {**os.environ, **manners, "MUJOCO_GL": backend}
        environment.pop("PYOPENGL_PLATFORM", None)  # MuJoCo sets it to what it has loaded, and then loads nothing else
        with _begun(environment, background) as worker:
            try:
                worker.send(request, blobs)
                answer = worker.receive(patience)
                able = True
                if request["agents"]:
                    answer = _video(worker, timeout)
            except (WorkerDied, WorkerTimeout) as error:
                late |= isinstance(error, WorkerTimeout)
                reasons.append(f"{backend}: {worker.ending() or worker.last_words() or error}")
                continue
        if "refused" in answer.header:
            raise VideoUnavailable(answer.header["refused"])
        return backend, answer
    if able:
        raise VideoUnavailable(f"Rendering the video broke off ({'; '.join(reasons)}); try again, or fewer seconds=.")
    if late:
        raise NoRenderer(
            f"No video: rendering did not begin within {patience:g} s. Try again when the machine is less busy."
        )
    raise NoRenderer(f"No video: this machine has no OpenGL to render with; {INSTALL}. ({'; '.join(reasons)})")


def _begun(environment: dict[str, str], background: bool) -> Worker:
    try:
        return Worker("openeureka.film.render", env=environment, nice=19 if background else None)
    except WorkerError as error:
        raise NoRenderer(f"No video. {error}") from None


def _video(worker: Worker, timeout: float) -> Frame:
    """The answer of a child that has found it can render. Raises WorkerDied: a driver may crash even then."""
    try:
        return worker.receive(timeout)
    except WorkerTimeout:
        raise VideoUnavailable(f"The video was not ready within {timeout:g} s; ask for fewer seconds=.") from None


_NONE = {"disable", "disabled", "off", "false", "0"}
"""Values of MUJOCO_GL by which a person says that nothing is to be drawn."""


def _backends() -> list[str]:
    """The back end that a person chose, then those that need no display, unless they chose to draw nothing."""
    chosen = os.environ.get("MUJOCO_GL", "").lower().strip()
    return list(dict.fromkeys(filter(None, (chosen, *(() if chosen in _NONE else ("egl", "osmesa"))))))
