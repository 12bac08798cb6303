"""Two rewards again, trained with seeds that had no part in choosing either."""

from __future__ import annotations

from pathlib import Path

import openeureka
from openeureka.config import RunConfig
from openeureka.method.given import seeds
from openeureka.method.lanes import polish_seeds
from openeureka.score import difference


def trained(
    config: RunConfig, rewards: tuple[str, str], directory: Path, count: int
) -> tuple[list[int], tuple[list[float], list[float]], list[float]]:
    """Train both side by side as the run did, or go on with it.

    Args:
        config: of the run in which one of them was chosen.
        rewards: names of built-in ones, or programs.
        directory: of the new run.
        count: seeds of each; from two on.

    Returns:
        The seeds; the held-out F of the first and of the second reward; the difference of the means, second less
        first, and the ends of its 95 % interval.
    """
    run = openeureka.train(
        config.env,
        list(rewards),
        dir=directory,
        seed=polish_seeds(config).stop,
        seeds=count,
        steps=config.steps,
        worlds=config.worlds,
        device=config.device,
    )
    first, second = (list(arm.scores) for arm in run.view.given.values())
    between = difference(second, first, [second, first])
    assert between is not None
    return list(seeds(run.config)), (first, second), [between.value, between.low, between.high]
