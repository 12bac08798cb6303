"""Draws docs/images/tasks.png: every task under random actions, a moment after its start.

python scripts/contact_sheet.py                        # needs OpenGL, MUJOCO_GL=egl without a display
python scripts/contact_sheet.py --env shadow_hand_pen --out pen.png
python scripts/contact_sheet.py --films sheet.png      # four moments of an encoded film of each, about 15 minutes

With --films it says what each film cost, and what share of the picture the moving things need: above 1, the edge cuts.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Sequence
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")  # MuJoCo reads it when it is imported

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from openeureka.film import mp4, video
from openeureka.film.stage import Stage
from openeureka.tasks import registry

OUT = Path(__file__).parents[1] / "docs" / "images" / "tasks.png"
COLUMNS = 7
WIDTH, HEIGHT, CAPTION, FONT = 272, 153, 34, 25  # [pixels] of a tile's picture, the line below it and its letters
HAND = "shadow_hand_"
"""Most names begin with this; a caption that people read at half its size has no room for it."""
OVERSAMPLING = 2
COLOURS = 144
SECONDS = 0.15  # of random control
FILM, MOMENTS = 3.0, 4  # [s], pictures of it


def tile(env: str) -> Image.Image:
    """One task with its name below."""
    stage = Stage(env, "random", seed=0)
    for _ in range(max(1, round(SECONDS / stage.dt))):
        stage.step()
    with stage.painter(OVERSAMPLING * WIDTH, OVERSAMPLING * HEIGHT) as paint:
        return framed(paint(), env)


def framed(picture: np.ndarray, env: str) -> Image.Image:
    """A picture as small as a tile, with a name below."""
    whole = Image.new("RGB", (WIDTH, HEIGHT + CAPTION), "white")
    whole.paste(Image.fromarray(picture).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS))
    pen = ImageDraw.Draw(whole)
    middle = WIDTH / 2, HEIGHT + CAPTION / 2
    pen.text(middle, env.removeprefix(HAND), "black", ImageFont.load_default(FONT), anchor="mm")
    return whole


def sheet(tiles: Sequence[Image.Image], most: int = COLUMNS) -> Image.Image:
    """Tiles in rows of at most `most`, none alone in the last row. The palette makes the file three times smaller, and
    nobody sees it."""
    columns = next((c for c in range(min(most, len(tiles)), 2, -1) if len(tiles) % c != 1), min(2, len(tiles)))
    width, height = tiles[0].size
    whole = Image.new("RGB", (columns * width, -(-len(tiles) // columns) * height), "white")
    for index, picture in enumerate(tiles):
        whole.paste(picture, (index % columns * width, index // columns * height))
    return whole.quantize(COLOURS, kmeans=2)


def filmed(env: str) -> list[Image.Image]:
    """Moments of a film of a task, as they are decoded, with its name and what it cost below."""
    begun = time.process_time() + sum(os.times()[2:4])
    encoded = video.render(env, "random", seconds=FILM)
    spent = time.process_time() + sum(os.times()[2:4]) - begun
    pictures = mp4.frames(encoded)
    stage, needed = Stage(env, "random", seed=0), []
    for _ in range(round(FILM / stage.dt)):
        needed.append(stage.director.sees(stage.data))
        stage.step()
    cost = f"{1000 * spent / len(pictures):.0f} ms of a core a picture, {len(encoded) / 1e6:.2f} MB"
    print(f"{env}: {cost}, needs {min(needed):.2f} to {max(needed):.2f}", flush=True)
    return [framed(pictures[(len(pictures) - 1) * index // (MOMENTS - 1)], env) for index in range(MOMENTS)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", action="append", choices=registry.names(), help="a task; may be repeated")
    parser.add_argument("--out", type=Path, default=OUT)
    parser.add_argument("--films", type=Path)
    options = parser.parse_args()
    envs = options.env or registry.names()
    out = options.films or options.out
    out.parent.mkdir(parents=True, exist_ok=True)
    if options.films:
        sheet([picture for env in envs for picture in filmed(env)], MOMENTS).save(out)
    else:
        sheet([tile(env) for env in envs]).save(out, optimize=True)
    print(f"{out}: {out.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
