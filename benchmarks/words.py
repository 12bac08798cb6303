"""Do a person's words steer a search? docs/reference/headline.md has the answer.

    python benchmarks/words.py                          # trains both groups and films them; half an hour on 2 cores
    python benchmarks/words.py --judge outputs/words/judge.json
                                                        # adds one judge's marks, 0 to 10 by film: {"00": 7, ...}
    python benchmarks/words.py --picture                # draws docs/images/words.webp from the films

Both groups are eight replies to the second prompt of a search on Ant, which differ in a paragraph: at its end one says
what a person thinks of the policies, `SAID`. All rewards train alike, with a seed that nothing was chosen by. Whether
their policies move as the person wants is told twice: by measures of what was said, in held-out episodes; and by
judges, who see the films in `outputs/words/films/` in an order drawn by lot, and know neither group nor reward. Films
are also there as sheets of pictures, for judges who look at pictures.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from random import Random
from statistics import fmean

import claims
import fresh
import numpy as np
import torch
from intervals import interval
from PIL import Image, ImageDraw, ImageFont
from records import OUTPUTS, ROOT, Record, command_line, machine, read, results, show, write
from safetensors.torch import load

import openeureka
from openeureka.film import mp4, video
from openeureka.numbers import spread
from openeureka.store import Store
from openeureka.training.episodes import EPISODES
from openeureka.training.evaluate import evaluate
from openeureka.types import Episodes

ENV = "ant"
SAID = (
    "It gallops. The whole body leaps, the torso pitches and rolls, and it lands hard. I want a calm walk instead: the "
    "torso level and always at the same height, no jumps, soft steps. It may be slower."
)
GROUPS = {"reflection": "without the words", "words": "with the words"}
MEASURES = {
    "fitness": "F held out",
    "tilt": "tilt of the torso [degrees]",
    "bounce": "spread of its height [cm]",
    "contact_force": "hardest landing [N]",
    "falls": "episodes that end in a fall",
    "judged": "judges, 0 to 10",
}
RESULTS = results("words")
FILMS, KEY = OUTPUTS / "words" / "films", OUTPUTS / "words" / "key.json"
PICTURE = ROOT / "docs" / "images" / "words.webp"
SECONDS, FROM, PICTURES, COLUMNS = 8.0, 120, 20, 5
"""[s] of a film; first picture of its sheet, number of pictures (every second one of 30 a second), and its columns."""
TITLES = ("measure", *GROUPS.values(), "difference, 95 % interval")


def measure(group: str) -> list[Record]:
    """What the policies of a group's rewards do."""
    rewards = claims.accepted(ENV, claims.asked(ENV, group))
    run = openeureka.train(ENV, rewards, dir=OUTPUTS / "words" / group, seed=claims.SEED, steps=claims.STEPS[ENV])
    own, lanes = policies(group), run.lanes
    found = []
    for play in evaluate(ENV, own, seed=claims.SEED, episodes=EPISODES, record=own):
        score = lanes[play.lane].held_out
        assert score is not None
        costs = {name: score.costs[name] for name in ("contact_force", "falls")}
        found.append({"fitness": score.fitness, **gait(play.recorded), **costs})
    return found


def policies(group: str) -> dict[str, bytes]:
    """Lane -> the policy that stands for its reward."""
    with Store.view(OUTPUTS / "words" / group) as store:
        scores = store.lanes.evaluations()
        found = {lane: store.lanes.policy(lane, score.peak) for lane, score in scores.items() if score.peak}
    return {lane: policy for lane, policy in found.items() if policy is not None}


def gait(recorded: Episodes | None) -> Record:
    """How level a torso is, over all states, and how steady its height in an episode."""
    assert recorded is not None
    state = load(recorded.states)
    owners = torch.tensor(recorded.owners)
    heights = [state["torso_height"][owners == one] for one in owners.unique()]
    return {
        "tilt": float(torch.rad2deg(torch.arccos(state["up_proj"].clamp(-1, 1))).mean()),
        "bounce": 100 * fmean(float(height.std()) for height in heights if len(height) > 1),
    }


def film() -> None:
    """Make a film and a sheet of every policy, numbered by lot; the key is kept in another folder."""
    shown = [(group, number, policy) for group in GROUPS for number, policy in enumerate(policies(group).values())]
    Random(claims.SEED).shuffle(shown)
    FILMS.mkdir(parents=True, exist_ok=True)
    for place, (_, _, policy) in enumerate(shown):
        made = FILMS / f"{place:02}.mp4"
        if not made.exists():
            seen = video.render(ENV, policy, seconds=SECONDS, seed=claims.SEED)
            sheet(mp4.frames(seen)).save(made.with_suffix(".png"))
            made.write_bytes(seen)
    write(KEY, {f"{place:02}": [group, number] for place, (group, number, _) in enumerate(shown)})


def films() -> dict[str, tuple[str, int]]:
    """Film -> group and number of the policy in it.

    Raises:
        SystemExit: where none was made here.
    """
    if not KEY.exists():
        raise SystemExit(
            f"{FILMS.relative_to(ROOT)} has no films: move {RESULTS.relative_to(ROOT)} away, "
            "and `python benchmarks/words.py` trains and films both groups."
        )
    return read(KEY)


def sheet(pictures: np.ndarray) -> Image.Image:
    """Pictures of a film side by side, in the order of reading."""
    shown = pictures[FROM : FROM + 2 * PICTURES : 2, ::2, ::2]
    rows = [np.concatenate(list(shown[start : start + COLUMNS]), axis=1) for start in range(0, PICTURES, COLUMNS)]
    return Image.fromarray(np.concatenate(rows))


def picture() -> None:
    """The policy of each group whose tilt is in the middle, side by side."""
    groups, places = read(RESULTS)["groups"], {(group, number): place for place, (group, number) in films().items()}
    sides = []
    for group, title in GROUPS.items():
        order = sorted(range(len(groups[group])), key=lambda number: groups[group][number]["tilt"])
        shown = mp4.frames((FILMS / f"{places[group, order[len(order) // 2]]}.mp4").read_bytes())
        sides.append([titled(frame, title) for frame in shown[FROM::2]])
    frames = [Image.fromarray(np.concatenate(pair, axis=1)) for pair in zip(*sides, strict=True)]
    frames[0].save(PICTURE, save_all=True, append_images=frames[1:], duration=66, loop=0, quality=40, method=4)


def titled(frame: np.ndarray, title: str) -> np.ndarray:
    """The middle of a frame, half as large, with a title."""
    small = Image.fromarray(frame[120:, 160:1120]).resize((400, 250), Image.Resampling.LANCZOS)
    ImageDraw.Draw(small).text((8, 6), title, "#1f2328", ImageFont.load_default(16))
    return np.asarray(small)


def judge(known: Record, marks: Mapping[str, float]) -> Record:
    """The results with one judge's marks added. Raises SystemExit where a film has none."""
    key = films()
    if set(marks) != set(key):
        raise SystemExit(f"Marks are wanted for the films {', '.join(sorted(key))}, each a number from 0 to 10.")
    for place, (group, number) in key.items():
        known["groups"][group][number].setdefault("marks", []).append(marks[place])
    return known


def values(group: Sequence[Record], name: str) -> list[float]:
    """A measure of a group's policies; of several judges the mean."""
    if name == "judged":
        return [fmean(policy["marks"]) for policy in group if "marks" in policy]
    return [policy[name] for policy in group]


def rows(measured: Record) -> list[tuple[str, ...]]:
    """One row per measure, with the difference of the groups' means; its interval is that over rewards."""
    found = []
    for name, title in MEASURES.items():
        without, told = (values(measured["groups"][group], name) for group in GROUPS)
        if without and told:
            found.append((title, spread(without), spread(told), interval(*fresh.between(without, told), digits=3)))
    return found


if __name__ == "__main__":
    parser = command_line(__doc__)
    parser.add_argument("--judge", type=Path, help="a file of marks")
    parser.add_argument("--picture", action="store_true")
    options = parser.parse_args()
    if options.picture:
        picture()
    elif options.judge:
        write(RESULTS, judge(read(RESULTS), json.loads(options.judge.read_text())))
    elif not read(RESULTS):
        groups = {group: measure(group) for group in GROUPS}
        film()
        where = {"steps": claims.STEPS[ENV], "seed": claims.SEED, **machine("cpu")}
        write(RESULTS, {"said": SAID, "groups": groups, **where})
    show(*rows(read(RESULTS)))
