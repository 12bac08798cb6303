"""scripts/contact_sheet.py, except the pictures that it renders."""

from types import ModuleType

import numpy as np
import pytest
from PIL import Image

from openeureka.tasks import registry


@pytest.fixture
def contact_sheet(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.setenv("MUJOCO_GL", "egl")  # otherwise the script sets it for all later tests
    import contact_sheet  # pyright: ignore[reportMissingImports]

    return contact_sheet


def test_tiles_fill_rows_from_the_left(contact_sheet: ModuleType):
    tiles = [Image.new("RGB", (4, 3), colour) for colour in ("red", "lime", "blue")]
    whole = contact_sheet.sheet(tiles, most=2).convert("RGB")
    assert whole.size == (8, 6)
    corners = [whole.getpixel(corner) for corner in ((0, 0), (4, 0), (0, 3), (4, 3))]
    assert corners == [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)]


@pytest.mark.parametrize(("count", "columns"), [(1, 1), (2, 2), (3, 3), (5, 5), (6, 4), (30, 5), (31, 4)])
def test_no_tile_stands_alone_in_the_last_row(contact_sheet: ModuleType, count: int, columns: int):
    assert contact_sheet.sheet([Image.new("RGB", (2, 1))] * count, most=5).width == 2 * columns


def test_every_name_fits_below_its_picture(contact_sheet: ModuleType):
    picture = np.full((9, 16, 3), 255, dtype=np.uint8)
    for env in registry.names():
        tile = np.asarray(contact_sheet.framed(picture, env))
        assert (tile[:, [0, -1]] == 255).all() and (tile < 128).any(), env
