"""What a person says on the page."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ..errors import FeedbackError
from ..store import Store, is_held
from ..types import Place, Remark, RemarkKind

_PLACE = re.compile(r"g(\d{1,9})s(\d{1,9})")


@dataclass(frozen=True, slots=True, kw_only=True)
class Ear:
    """Whether a run listens, and what it has not taken up yet."""

    listens: bool
    """Something said now will reach the model."""
    waits: bool
    """It goes on when a person says so."""
    unheard: tuple[Remark, ...]


def ear(directory: Path) -> Ear:
    """Raises StoreError when there is no run."""
    with Store.view(directory) as store:
        hearings, done = store.config.hearings, store.glance().generations
        listens = hearings > 0 and store.heard(hearings - 1) is None
        waits = listens and 0 < done <= hearings and store.heard(done - 1) is None and is_held(directory)
        return Ear(listens=listens, waits=waits, unheard=store.unheard())


def read(form: Mapping[str, str]) -> tuple[Remark, ...]:
    """The remarks of a form: `words`, a candidate as `favourite` or `veto`, a `vote` such as g0s3>g0s1, and `go`.

    Raises:
        FeedbackError: where a candidate is not named like g0s1, or nothing is said.
    """
    remarks = [
        Remark(kind=kind, candidate=_place(form[kind]))
        for kind in (RemarkKind.FAVOURITE, RemarkKind.VETO)
        if kind in form
    ]
    if words := form.get("words", "").strip():
        remarks.append(Remark(kind=RemarkKind.WORDS, text=words))
    if RemarkKind.VOTE in form:
        better, _, worse = form[RemarkKind.VOTE].partition(">")
        remarks.append(Remark(kind=RemarkKind.VOTE, candidate=_place(better), over=_place(worse)))
    if RemarkKind.GO in form:
        remarks.append(Remark(kind=RemarkKind.GO))
    if not remarks:
        raise FeedbackError("Nothing was said; write some words, or choose a candidate.")
    return tuple(remarks)


def _place(text: str) -> Place:
    match = _PLACE.fullmatch(text)
    if match is None:
        raise FeedbackError(f"`{text}` is no candidate; they are called g0s1 and the like.")
    return Place(int(match[1]), int(match[2]))
