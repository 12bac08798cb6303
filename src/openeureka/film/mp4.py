"""Pictures to an mp4 and back, by the ffmpeg that comes with the imageio-ffmpeg wheel.

That package's own reader and writer fork this process, which the kernel refuses once the process has grown large.
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from io import BytesIO
from itertools import chain
from pathlib import Path

import numpy as np
from PIL import Image

_FORMAT = ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-profile:v", "high", "-movflags", "+faststart"]
"""Every browser plays this, and starts before it has the whole file."""
_EFFORT = ["-preset", "veryfast", "-crf", "23"]
"""Costs a quarter of the time of ffmpeg's default."""

_SMALL = "fps=10,scale=320:-2,split[picture][copy];[copy]palettegen[palette];[picture][palette]paletteuse"


def encode(pictures: Iterable[np.ndarray], rate: int) -> bytes:
    """An mp4 of pictures, uint8 (height, width, 3) with even height and width, `rate` of them a second."""
    pictures = iter(pictures)
    first = next(pictures)
    height, width, _ = first.shape
    raw = f"-f rawvideo -pix_fmt rgb24 -video_size {width}x{height} -framerate {rate} -i -".split()
    with tempfile.TemporaryDirectory() as folder:
        path, said = Path(folder) / "film.mp4", Path(folder) / "said"
        command = [*_ffmpeg(), *raw, *_FORMAT, *_EFFORT, str(path)]
        with (
            said.open("wb") as stderr,
            suppress(BrokenPipeError),  # ffmpeg has died; the file `said` tells why
            subprocess.Popen(command, stdin=subprocess.PIPE, stderr=stderr) as process,
        ):
            assert process.stdin is not None
            for picture in chain([first], pictures):
                process.stdin.write(np.ascontiguousarray(picture).data)
        if process.returncode:
            raise RuntimeError(f"ffmpeg ended with {process.returncode}: {said.read_text(errors='replace').strip()}")
        return path.read_bytes()


def frames(mp4: bytes) -> np.ndarray:
    """The pictures of an mp4, uint8 (T, height, width, 3)."""
    pictures = _converted(mp4, "-f", "image2pipe", "-c:v", "ppm")
    width, height = Image.open(BytesIO(pictures)).size
    head = len(b"P6\n%d %d\n255\n" % (width, height))
    rows = np.frombuffer(pictures, np.uint8).reshape(-1, head + height * width * 3)
    return rows[:, head:].reshape(-1, height, width, 3)


def gif(mp4: bytes) -> tuple[bytes, int, int]:
    """An mp4 as a GIF that is small enough for an experiment tracker, with its width and height."""
    picture = _converted(mp4, "-vf", _SMALL, "-f", "gif")
    return picture, *Image.open(BytesIO(picture)).size


def _converted(mp4: bytes, *options: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"  # a pipe will not do: the index of an mp4 may stand at its end
        path.write_bytes(mp4)
        return subprocess.run([*_ffmpeg(), "-i", str(path), *options, "-"], stdout=subprocess.PIPE, check=True).stdout


def _ffmpeg() -> list[str]:
    import imageio_ffmpeg  # at the top of the module, its absence would look like that of OpenGL

    return [imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error"]
