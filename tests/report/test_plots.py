from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from openeureka.report import plots
from openeureka.types import Generation, History

from .search import BASELINES, HISTORY, refused, run


def picture(history, results) -> np.ndarray:
    return np.asarray(Image.open(BytesIO(plots.summary(run(history, results)))))


def test_the_summary_shows_candidates_and_baselines():
    with_baselines, without = picture(HISTORY, BASELINES), picture(HISTORY, [])
    assert with_baselines.shape == without.shape == (450, 1500, 4)
    assert (with_baselines != without).any()


@pytest.mark.parametrize("history", [History(), History((Generation(0, (refused(0, 0, "x"),)),))])
def test_a_search_with_nothing_trained_is_drawn_empty(history):
    assert picture(history, []).shape == (450, 1500, 4)
