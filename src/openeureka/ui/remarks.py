"""What a person says on the page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from ..errors import FeedbackError
from ..store import Store, is_held
from ..store.remarks import remark
from ..types import Remark, RemarkKind


class Ear(NamedTuple):
    """Whether a run listens."""

    listens: bool
    """Something said now will reach the model."""
    waits: bool
    """It goes on when a person says so."""


def ear(directory: Path) -> Ear:
    """Raises StoreError when there is no run."""
    with Store.view(directory) as store:
        hearings, done = store.config.hearings, store.glance().generations
        listens = hearings > 0 and store.remarks.heard(hearings - 1) is None
        waits = listens and 0 < done <= hearings and store.remarks.heard(done - 1) is None and is_held(directory)
    return Ear(listens=listens, waits=waits)


def read(form: Mapping[str, str]) -> tuple[Remark, ...]:
    """The remarks of a form: `words`, a candidate as `favourite` or `veto`, a `vote` such as g0s3:g0s1, and `go`.

    Raises:
        FeedbackError: where a candidate is not named like g0s1, or nothing is said.
    """
    remarks = [remark(f"{mark}={form[mark]}") for mark in ("favourite", "veto", "vote") if mark in form]
    if words := form.get("words", "").strip():
        remarks.append(Remark(kind=RemarkKind.WORDS, text=words))
    if "go" in form:
        remarks.append(Remark(kind=RemarkKind.GO))
    if not remarks:
        raise FeedbackError("Nothing was said; write some words, or choose a candidate.")
    return tuple(remarks)
