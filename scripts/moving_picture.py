"""Draws docs/images/found.webp: twelve balls under the policies of the human and of a generated reward, and F of both.

python benchmarks/found.py && python scripts/moving_picture.py     # needs OpenGL and the extra `bench`
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Sequence
from pathlib import Path
from statistics import mean

os.environ.setdefault("MUJOCO_GL", "egl")  # MuJoCo reads it when it is imported
os.environ.setdefault("OMP_NUM_THREADS", "1")  # torch's threads, which would spin and wait for each other

import matplotlib
import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from openeureka.film.looks import decorated
from openeureka.tasks import registry
from openeureka.training.evaluate import HELD_OUT_SEED
from openeureka.training.policy import Player, Policy

matplotlib.use("Agg")
from matplotlib import pyplot as plt

ROOT = Path(__file__).parents[1]
OUT = ROOT / "docs" / "images" / "found.webp"
RUN = ROOT / "outputs" / "found"
RESULTS = ROOT / "benchmarks" / "results" / "found.json"
NAMES = {"human": "human reward", "embedded": "generated reward"}
COLOURS = {"human": "#bc4c00", "embedded": "#0969da"}
SEED = 100  # the first of those trained
BALLS = 12  # the first of its held-out episodes
COLUMNS, TILE, GAP, HEAD, FOOT = 4, (96, 84), 2, 30, 8  # [pixels]
STEPS, EVERY, HOLD = 498, 7, 25  # of an episode, of these a picture, pictures that the end stays
INK, PAPER = "#1f2328", "#ffffff"
FADED = Image.new("RGB", TILE, "#d0d7de")
PAINT = {"ball": (0.95, 0.45, 0.1, 1.0), "tray": (0.8, 0.82, 0.85, 1.0)}  # bodies


def played() -> tuple[np.ndarray, np.ndarray]:
    """Positions (pictures, policies * balls, nq), and the step (policies * balls,) at which a ball fell, or STEPS."""
    paths = [RUN / "lanes" / f"{name}-s{SEED}" / "best_fitness.safetensors" for name in NAMES]
    policies = [Policy.from_bytes(path.read_bytes()) for path in paths]
    simulation = registry.make("ballbalance", worlds=BALLS, lane_seeds=[SEED + HELD_OUT_SEED] * len(NAMES), threads=1)
    player, observation = Player(policies), simulation.reset()
    ends = np.full(BALLS * len(NAMES), STEPS)
    positions = []
    for number in range(STEPS):
        if number % EVERY == 0:
            positions.append([simulation.sim.snapshot(world)[1].qpos.copy() for world in range(len(ends))])
        step = simulation.step(player(observation))
        ends[(ends == STEPS) & step.terminated.numpy()] = number
        observation = step.observation
    return np.array(positions), ends


def tiles(positions: np.ndarray, ends: np.ndarray) -> list[list[Image.Image]]:
    """A picture of each world at each time; one whose ball fell fades."""
    model = decorated(type(registry.make("ballbalance", worlds=1).task), ())
    data, look = mujoco.MjData(model), mujoco.MjvCamera()
    look.distance, look.elevation, look.azimuth = 2.0, -32.0, 35.0
    look.lookat[:] = (0.0, 0.0, 0.5)
    for name, colour in PAINT.items():
        model.geom_rgba[model.body(name).geomadr[0]] = colour
    frames: list[list[Image.Image]] = []
    with mujoco.Renderer(model, 2 * TILE[1], 2 * TILE[0]) as renderer:
        for index, worlds in enumerate(positions):
            frame = []
            for world, qpos in enumerate(worlds):
                gone = index * EVERY - ends[world]
                if gone <= 0:
                    data.qpos[:] = qpos
                    mujoco.mj_forward(model, data)
                    renderer.update_scene(data, look)
                    frame.append(Image.fromarray(renderer.render()).resize(TILE, Image.Resampling.LANCZOS))
                else:
                    frame.append(Image.blend(frames[-1][world], FADED, 0.25 * (gone < 4 * EVERY)))
            frames.append(frame)
    return frames


def side(name: str, frames: Sequence[Sequence[Image.Image]], ends: np.ndarray) -> list[Image.Image]:
    """One policy's tiles side by side, with a count of the balls that are left."""
    width, height = COLUMNS * (TILE[0] + GAP), HEAD + -(-BALLS // COLUMNS) * (TILE[1] + GAP)
    pictures = []
    for index, frame in enumerate(frames):
        picture, left = Image.new("RGB", (width, height), PAPER), int((ends >= index * EVERY).sum())
        for place, tile in enumerate(frame):
            picture.paste(tile, (place % COLUMNS * (TILE[0] + GAP), HEAD + place // COLUMNS * (TILE[1] + GAP)))
        pen = ImageDraw.Draw(picture)
        pen.text((2, 5), NAMES[name], COLOURS[name], ImageFont.load_default(17))
        pen.text((width - 4, 5), f"{left} of {BALLS} left", INK, ImageFont.load_default(17), anchor="ra")
        pictures.append(picture)
    return pictures


def chart(height: int) -> Image.Image:
    """Held-out F of both rewards: a dot per seed, a line at the mean."""
    held_out = json.loads(RESULTS.read_text())["held_out"]
    figure, axes = plt.subplots(figsize=(2.1, height / 100), dpi=200, layout="constrained")
    for place, (name, colour) in enumerate(COLOURS.items()):
        values = held_out[name]
        axes.plot([place] * len(values), values, "o", color=colour, markersize=5, alpha=0.6, markeredgewidth=0)
        axes.hlines(mean(values), place - 0.25, place + 0.25, color=colour, linewidth=2)
        axes.annotate(f"{mean(values):.0f}", (place + 0.3, mean(values)), va="center", color=colour, fontsize=9)
    axes.set_title("steps on the table, held out", fontsize=8, color=INK)
    axes.set_xticks(range(len(NAMES)), [name.replace(" ", "\n") for name in NAMES.values()], fontsize=8)
    axes.set_xlim(-0.5, 1.7)
    axes.set_ylim(0, 499)
    axes.tick_params(axis="y", labelsize=7)
    axes.spines[["top", "right"]].set_visible(False)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    picture = Image.open(buffer).convert("RGB")
    return picture.resize((picture.width * height // picture.height, height), Image.Resampling.LANCZOS)


def film(left: Sequence[Image.Image], right: Sequence[Image.Image]) -> list[Image.Image]:
    """Both sides and the chart, with a margin."""
    drawn = chart(left[0].height)
    width = left[0].width + right[0].width + drawn.width + 4 * FOOT
    frames = []
    for one, two in zip(left, right, strict=True):
        frame = Image.new("RGB", (width, one.height + 2 * FOOT), PAPER)
        frame.paste(one, (FOOT, FOOT))
        frame.paste(two, (one.width + 2 * FOOT, FOOT))
        frame.paste(drawn, (one.width + two.width + 3 * FOOT, FOOT))
        frames.append(frame)
    return frames + frames[-1:] * HOLD


def main() -> None:
    positions, ends = played()
    frames = tiles(positions, ends)
    sides = []
    for lane, name in enumerate(NAMES):
        own = slice(lane * BALLS, (lane + 1) * BALLS)
        sides.append(side(name, [frame[own] for frame in frames], ends[own]))
        print(f"{NAMES[name]}: {int((ends[own] == STEPS).sum())} of {BALLS} balls left")
    first, *others = film(*sides)
    first.save(OUT, save_all=True, append_images=others, duration=10 * EVERY, loop=0, quality=32, method=4)
    print(f"{OUT}: {OUT.stat().st_size / 1e6:.2f} MB, {first.width} x {first.height}")


if __name__ == "__main__":
    main()
