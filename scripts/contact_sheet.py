"""Draws docs/images/tasks.png: every task under random actions, a moment after its start.

python scripts/contact_sheet.py                        # needs OpenGL, MUJOCO_GL=egl without a display
python scripts/contact_sheet.py --env shadow_hand_pen --out pen.png
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")  # MuJoCo reads it when it is imported

import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from openeureka.report.stage import Stage
from openeureka.tasks import registry

OUT = Path(__file__).parents[1] / "docs" / "images" / "tasks.png"
COLUMNS = 5
WIDTH, HEIGHT, CAPTION = 360, 270, 28  # [pixels] of a tile's picture and of the line below it
OVERSAMPLING = 2
COLOURS = 256
SECONDS = 0.15  # of random control


def tile(env: str) -> Image.Image:
    """One task with its name below."""
    stage = Stage(env, "random", seed=0)
    for _ in range(max(1, round(SECONDS / stage.dt))):
        stage.step()
    picture = Image.new("RGB", (WIDTH, HEIGHT + CAPTION), "white")
    picture.paste(Image.fromarray(photograph(stage)).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS))
    pen = ImageDraw.Draw(picture)
    pen.text((WIDTH / 2, HEIGHT + CAPTION / 2), env, "black", ImageFont.load_default(17), anchor="mm")
    return picture


def photograph(stage: Stage) -> np.ndarray:
    """What the task's camera sees, large enough to be smoothed."""
    stage.model.vis.global_.offwidth, stage.model.vis.global_.offheight = OVERSAMPLING * WIDTH, OVERSAMPLING * HEIGHT
    with mujoco.Renderer(stage.model, OVERSAMPLING * HEIGHT, OVERSAMPLING * WIDTH) as renderer:
        renderer.update_scene(stage.data, stage.camera)
        return renderer.render()


def sheet(tiles: Sequence[Image.Image]) -> Image.Image:
    """Tiles in rows of COLUMNS, with a palette: a third of the size, and no eye sees it."""
    columns = min(COLUMNS, len(tiles))
    width, height = tiles[0].size
    whole = Image.new("RGB", (columns * width, -(-len(tiles) // columns) * height), "white")
    for index, picture in enumerate(tiles):
        whole.paste(picture, (index % columns * width, index // columns * height))
    return whole.quantize(COLOURS, kmeans=2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", action="append", choices=registry.names(), help="a task; may be repeated")
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    options.out.parent.mkdir(parents=True, exist_ok=True)
    sheet([tile(env) for env in options.env or registry.names()]).save(options.out, optimize=True)
    print(f"{options.out}: {options.out.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
