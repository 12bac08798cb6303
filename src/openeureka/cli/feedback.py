"""`eureka feedback`: what a person says of a run, as words of a command line or of a line typed while it waits."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from ..errors import FeedbackError
from ..store import say
from ..types import Place, Remark, RemarkKind

_MARK = re.compile(r"(favourite|veto|vote)=(.*)")
_PLACE = re.compile(r"g(\d{1,6})s(\d{1,6})")


def feedback(directory: Path, words: Sequence[str]) -> None:
    """Commit the remarks and say what follows."""
    remarks = [remark(word) for word in words]
    if not remarks:
        raise FeedbackError('Say something, for example: eureka feedback DIR "too jerky" favourite=g0s3 go')
    say(directory, *remarks)
    go = any(said.kind is RemarkKind.GO for said in remarks)
    print("The run goes on." if go else "Kept for the next generation; the run goes on when you say `go`.")


def typed(line: str) -> list[Remark]:
    """The remarks of one line: marks, words, or nothing more to say. Raises FeedbackError."""
    line = line.strip()
    words = line.split() if _MARK.match(line) else [line or "go"]
    return [remark(word) for word in words]


def remark(word: str) -> Remark:
    """`go`, `favourite=g0s3`, `veto=g0s1`, `vote=g0s3:g0s1`, and everything else are words for the model.

    Raises:
        FeedbackError: for a mark that names no candidate.
    """
    if word == "go":
        return Remark(kind=RemarkKind.GO)
    mark = _MARK.fullmatch(word)
    if mark is None:
        return Remark(kind=RemarkKind.WORDS, text=word)
    kind, named = RemarkKind(mark[1]), mark[2]
    if kind is not RemarkKind.VOTE:
        return Remark(kind=kind, candidate=_place(named))
    better, _, worse = named.replace(">", ":").partition(":")  # an unquoted > is the shell's
    return Remark(kind=kind, candidate=_place(better), over=_place(worse))


def _place(name: str) -> Place:
    found = _PLACE.fullmatch(name)
    if found is None:
        raise FeedbackError(f"`{name}` names no candidate; write g0s3 for slot 3 of generation 0, a vote as g0s3:g0s1.")
    return Place(int(found[1]), int(found[2]))
