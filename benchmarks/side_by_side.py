"""Films policies of the human and of the generated reward side by side: docs/images/hands.webp.

    python benchmarks/side_by_side.py    # trains what is missing, about 15 minutes on 2 cores; needs OpenGL

On these tasks the generated reward is better (docs/reference/headline.md). Both rewards train with one seed: of those
that chose nothing, the one with the middle F of the generated reward. Their policies play with noise, as they do for F.
Runs are under `outputs/side_by_side/`; one that was killed goes on.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

os.environ.setdefault("MUJOCO_GL", "egl")  # MuJoCo reads it when it is imported

import mujoco
import table
from PIL import Image, ImageDraw, ImageFont, ImageOps
from records import OUTPUTS, ROOT, Record, command_line, read

import openeureka
from openeureka.film.camera import Camera
from openeureka.film.looks import decorated, place_ghosts
from openeureka.tasks import registry
from openeureka.training.evaluate import HELD_OUT_SEED
from openeureka.training.policy import Player, Policy

PICTURE = ROOT / "docs" / "images" / "hands.webp"
TASKS = {
    "shadow_hand_pen": "pull the cap off a pen",
    "shadow_hand_swing_cup": "turn a cup by its handles",
    "shadow_hand_door_close_outward": "close a double door",
}
REWARDS = {"human reward": "#bc4c00", "generated reward": "#0969da"}
SECONDS, EVERY, FLASH = 12.0, 10, 4
"""[s] of play; steps between two pictures; and pictures for which a success shows."""
TILE, STRIP, RIM = (240, 165), 20, 4
"""[pixels] of a picture, of the text above it, and of the rim by which a success shows."""
INK, PAPER, GREEN = "#1f2328", "#ffffff", "#2da44e"


@dataclass(frozen=True)
class Moment:
    """What is seen of one policy at one time."""

    picture: Image.Image
    successes: int
    """Up to now."""
    episodes: int
    """That have ended."""


def seed(row: Record) -> int:
    """Of the seeds that chose nothing, the one with the middle F of the generated reward."""
    seeds, scores = row["confirmed"]["seeds"], row["confirmed"]["generated"]
    return sorted(seeds, key=lambda one: scores[seeds.index(one)])[len(seeds) // 2]


def trained(env: str) -> list[Policy]:
    """A policy of each reward, which trains where it has not."""
    row, directory = read(table.RESULTS)[env], OUTPUTS / "side_by_side" / env
    rewards = ["human", table.reward_file(env).read_text()]
    run = openeureka.train(env, rewards, dir=directory, seed=seed(row), seeds=1, steps=row["steps"])
    lanes = [lane.id for lane in run.view.lanes.values() if lane.role == "given"]
    return [
        Policy.from_bytes((directory / "lanes" / f"{lane}/best_fitness.safetensors").read_bytes()) for lane in lanes
    ]


def played(env: str, policies: Sequence[Policy]) -> list[list[Moment]]:
    """What is seen of each policy, one world each."""
    simulation = registry.make(env, worlds=1, lane_seeds=[HELD_OUT_SEED] * len(policies), threads=1)
    task, player, observation = simulation.task, Player(list(policies), noise=HELD_OUT_SEED), simulation.reset()
    model = decorated(type(task), task.ghosts())
    scenes = [mujoco.MjData(model) for _ in policies]
    cameras: list[mujoco.MjvCamera] = []
    seen: list[list[Moment]] = [[] for _ in policies]
    successes, episodes = [0] * len(policies), [0] * len(policies)
    with mujoco.Renderer(model, 2 * TILE[1], 2 * TILE[0]) as renderer:
        for number in range(round(SECONDS / task.control_dt)):
            for world, scene in enumerate(scenes):
                scene.qpos[:] = simulation.sim.snapshot(world)[1].qpos
                place_ghosts(model, scene, task.ghosts())
                mujoco.mj_forward(model, scene)
                if number == 0:
                    cameras.append(Camera(model, scene, task.view, TILE[0] / TILE[1]).eye)
                if number % EVERY == 0:
                    renderer.update_scene(scene, cameras[world])
                    picture = Image.fromarray(renderer.render()).resize(TILE, Image.Resampling.LANCZOS)
                    seen[world].append(Moment(picture, successes[world], episodes[world]))
            step = simulation.step(player(observation))
            observation = step.observation
            for world in range(len(policies)):
                episodes[world] += int(step.ended[world])
                successes[world] += int(step.score.weight[world] > 0 and step.score.value[world] > 0)
    for name, moments in zip(REWARDS, seen, strict=True):
        print(f"{env}, {name}: {moments[-1].successes} of {moments[-1].episodes} episodes succeed", flush=True)
    return seen


def frame(moments: Sequence[Moment], index: int, name: str) -> Image.Image:
    """A picture with a text above it; for some time after a success its rim is green."""
    now, before = moments[index], moments[max(0, index - FLASH)]
    picture = now.picture
    if now.successes > before.successes:
        picture = ImageOps.expand(ImageOps.crop(picture, RIM), RIM, GREEN)
    whole = Image.new("RGB", (TILE[0], STRIP + TILE[1]), PAPER)
    whole.paste(picture, (0, STRIP))
    pen, font = ImageDraw.Draw(whole), ImageFont.load_default(14)
    pen.text((4, 2), name, REWARDS[name], font)
    if now.episodes:
        pen.text((TILE[0] - 6, 2), f"{now.successes} of {now.episodes} succeed", INK, font, anchor="ra")
    return whole


def picture(tasks: Sequence[Sequence[Sequence[Moment]]], index: int) -> Image.Image:
    """All films at one time: a column for each task, a row for each reward."""
    width, height = TILE[0], STRIP + TILE[1]
    whole = Image.new("RGB", (width * len(tasks), STRIP + height * len(REWARDS)), PAPER)
    pen = ImageDraw.Draw(whole)
    for column, (title, films) in enumerate(zip(TASKS.values(), tasks, strict=True)):
        pen.text(((column + 0.5) * width, 2), title, INK, ImageFont.load_default(15), anchor="ma")
        for row, (name, moments) in enumerate(zip(REWARDS, films, strict=True)):
            whole.paste(frame(moments, index, name), (column * width, STRIP + row * height))
    return whole


def main() -> None:
    tasks = [played(env, trained(env)) for env in TASKS]
    pictures = [picture(tasks, index) for index in range(min(len(films[0]) for films in tasks))]
    pictures[0].save(PICTURE, save_all=True, append_images=pictures[1:], duration=100, loop=0, quality=18, method=6)
    print(f"{PICTURE}: {PICTURE.stat().st_size / 1e6:.2f} MB, {pictures[0].width} x {pictures[0].height}")


if __name__ == "__main__":
    command_line(__doc__).parse_args()
    main()
