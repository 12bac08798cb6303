"""What a video shows of an environment that draws itself."""

from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
import torch

pytest.importorskip("gymnasium", reason="needs Gymnasium: pip install 'openeureka[gym]'")

from adapters import worlds  # noqa: F401  registers its environments

from openeureka.film.render import frames
from openeureka.film.stage import NothingDrawn, Screen, draws_itself
from openeureka.tasks import registry
from openeureka.training.evaluate import evaluate
from openeureka.training.policy import Policy
from openeureka.training.ppo import PPO
from openeureka.types import Dynamics


def test_an_environment_is_filmed_as_it_draws_itself():
    pytest.importorskip("pygame", reason="needs pygame: pip install 'openeureka[gym]'")
    assert draws_itself("gym:CartPole-v1") and not draws_itself("gym:Hopper-v5")
    pictures = list(frames([Screen("gym:CartPole-v1", "random", 0)], 0.2))
    assert len(pictures) == 6 and pictures[0].shape == (720, 1280, 3)  # 0.2 s at 30 pictures a second
    assert (pictures[0] != pictures[-1]).any()
    # It draws 600 x 400 pixels on white: 1080 x 720 of them fit, with 100 black ones on either side.
    assert not pictures[0][:, :100].any() and not pictures[0][:, 1180:].any()
    assert pictures[0][0, 100:1180].all()


def test_a_caption_is_written_on_what_an_environment_draws():
    pytest.importorskip("pygame", reason="needs pygame: pip install 'openeureka[gym]'")
    plain, captioned = (next(frames([Screen("gym:CartPole-v1", "zero", 0)], 0.1, said)) for said in ((), ("zero",)))
    assert (plain != captioned)[16:50, 16:90].any() and (plain == captioned)[100:].all()


def test_a_film_lasts_as_long_as_what_it_shows_where_a_step_is_longer_than_a_picture():
    class Slow:
        dt = 0.1

        def __init__(self):
            self.taken = 0

        @contextmanager
        def painter(self, width, height):
            yield lambda: np.full((height, width, 3), self.taken, np.uint8)

        def step(self):
            self.taken += 1

    stages: Any = [Slow()]
    pictures = list(frames(stages, 1.0))
    assert [picture[0, 0, 0] for picture in pictures] == [step for step in range(10) for _ in range(3)]


def test_opacity_is_left_out_of_a_picture():
    picture = next(frames([Screen("gym:Openeureka/Clear-v0", "zero", 0)], 0.1))
    assert picture.shape == (720, 1280, 3) and (picture == (255, 0, 0)).all()


def test_one_without_pictures_says_so():
    with pytest.raises(NothingDrawn, match="does not render pictures"):
        next(frames([Screen("gym:Openeureka/Clock-v0", "zero", 0)], 1.0))


def test_where_nobody_knows_the_masses_nothing_is_played_with_others():
    task = registry.get("gym:CartPole-v1+episode_length=5")
    ppo = PPO([0], 4, 2, task.recipe, torch.device("cpu"), task.choices)
    policy = Policy.of(task.env, ppo, 0).to_bytes()
    scores = evaluate(
        task.env, {"heavy": policy, "own": policy}, seed=0, episodes=4, dynamics={"heavy": Dynamics(mass=1.1)}
    )
    found = {score.lane: (score.fitness, score.episodes) for score in scores}
    assert found == {"heavy": (None, 0), "own": (5.0, 4)}  # any policy keeps the pole up for five steps
