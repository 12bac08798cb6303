"""scripts/contact_sheet.py, but for what it photographs."""

from pathlib import Path

import pytest
from PIL import Image

ROOT = Path(__file__).parents[2]


def test_tiles_fill_rows_from_the_left(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("MUJOCO_GL", "egl")  # as the script would, but only for now
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    import contact_sheet  # pyright: ignore[reportMissingImports]

    tiles = [Image.new("RGB", (4, 3), colour) for colour in ("red", "lime", "blue")]
    whole = contact_sheet.sheet(tiles, most=2).convert("RGB")
    assert whole.size == (8, 6)
    corners = [whole.getpixel(corner) for corner in ((0, 0), (4, 0), (0, 3), (4, 3))]
    assert corners == [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)]
