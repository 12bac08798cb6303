"""What a person says of a run: how it is written in words, and which generation has heard it."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ..errors import FeedbackError, nearest
from ..types import Place, Remark, RemarkKind
from .db import Database
from .rows import decode_remark, encode_remark

_MARK = re.compile(r"(favou?rite|veto|vote)=(.*)")
_MARKS = ("favourite", "favorite", "veto", "vote")
_WORD = re.compile(r"""(?<!\S)(["'])(?P<quoted>.*?)\1(?!\S)|\S+""")
_SETTING = re.compile(r"(\w+)=(\S*)")
_PLACE = re.compile(r"g(\d{1,6})s(\d{1,6})")


class RemarkLog:
    """Remarks in the order in which they were made; each enters the history of one generation, for good."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def say(self, *remarks: Remark) -> None:
        """Commit what a person said, all or none; it counts for the generation that is asked for next."""
        self._database.put("remarks", *map(encode_remark, remarks))

    def all(self) -> tuple[Remark, ...]:
        """What was said, heard or not."""
        return self._between(0)

    def unheard(self) -> tuple[Remark, ...]:
        """What was said and entered no history yet."""
        return self._between(self._last_heard())

    def hear(self, generation: int) -> tuple[Remark, ...]:
        """Close the remarks on a generation: what is unheard is part of its history from now on, later ones are not."""
        rows = self._database.rows("remarks", order=("id",))
        self._database.put("heard", {"generation": generation, "remarks": rows[-1]["id"] if rows else 0})
        remarks = self.heard(generation)
        assert remarks is not None
        return remarks

    def heard(self, generation: int) -> tuple[Remark, ...] | None:
        """What a person said after a generation; None when it may still be added to."""
        row = self._database.row("heard", generation=generation)
        return self._between(self._last_heard(before=generation), row["remarks"]) if row is not None else None

    def _last_heard(self, before: int | None = None) -> int:
        """Id of the last remark that a generation (earlier than `before`) has heard; ids begin with 1."""
        closed = self._database.rows("heard")
        return max((r["remarks"] for r in closed if before is None or r["generation"] < before), default=0)

    def _between(self, after: int, last: int | None = None) -> tuple[Remark, ...]:
        rows = self._database.rows("remarks", order=("id",))
        wanted = [dict(row) for row in rows if row["id"] > after and (last is None or row["id"] <= last)]
        return tuple(self._database.decoded(decode_remark, row) for row in wanted)


# --- words and marks -------------------------------------------------------------------------------------------------


def typed(line: str) -> list[Remark]:
    """The remarks of one line, as `spoken` has those of its words; an empty line is `go`. Raises FeedbackError."""
    words = [match["quoted"] if match[1] else match[0] for match in _WORD.finditer(line)]
    return spoken(words or ["go"])


def spoken(words: Sequence[str]) -> list[Remark]:
    """The remarks of a command line: marks, each word with a blank (it was quoted), all others as one sentence, and
    `go` where they end so. Raises FeedbackError."""
    words = [word for word in map(str.strip, words) if word]
    last = [words.pop()] if words and _is_go(words[-1]) else []
    marks = [word for word in words if _MARK.fullmatch(word)]
    others = [word for word in words if not _MARK.fullmatch(word)]
    quoted = [word for word in others if len(word.split()) > 1]
    loose = [word for word in others if len(word.split()) == 1]
    for word in loose:
        _refuse_unknown_mark(word, alone=False)
    return [remark(part) for part in (*marks, *quoted, " ".join(loose), *last) if part]


def is_marked(line: str) -> bool:
    """Whether a line is more than words: it is `go`, or holds a mark or what was meant for one."""
    settings = filter(None, map(_SETTING.match, line.split()))
    return _is_go(line.strip()) or any(nearest(setting[1].lower(), _MARKS) for setting in settings)


def remark(word: str) -> Remark:
    """`go`, `favourite=g0s3`, `veto=g0s1`, `vote=g0s3:g0s1`, and everything else are words for the model.

    Raises:
        FeedbackError: for a mark that names no candidate, and for what looks like a mark and is none.
    """
    if _is_go(word):
        return Remark(kind=RemarkKind.GO)
    mark = _MARK.fullmatch(word)
    if mark is None:
        _refuse_unknown_mark(word)
        return Remark(kind=RemarkKind.WORDS, text=word)
    kind, named = RemarkKind(mark[1].replace("favorite", "favourite")), mark[2]
    if kind is not RemarkKind.VOTE:
        return Remark(kind=kind, place=_place(named, word))
    better, _, worse = named.replace(">", ":").partition(":")  # an unquoted > is the shell's
    if not (better and worse):
        raise FeedbackError(
            f"`{word}` does not name two candidates; a vote does, the better one first: vote=g0s3:g0s1."
        )
    if _place(better, word) == _place(worse, word):
        raise FeedbackError(f"`{named}` votes for a candidate over itself; name two, as g0s3:g0s1.")
    return Remark(kind=kind, place=_place(better, word), over=_place(worse, word))


def _is_go(word: str) -> bool:
    return word.lower() == "go"


def _refuse_unknown_mark(word: str, *, alone: bool = True) -> None:
    """What was meant for the run must not silently become words for the model; a setting among others may be meant for
    the model, unless it is nearly a mark."""
    setting = _SETTING.match(word)
    if setting is None:
        return
    guess = nearest(setting[1].lower(), _MARKS)
    if guess or (alone and setting.end() == len(word)):
        raise FeedbackError(
            f"There is no `{setting[1]}=` to say.{guess} Marks are favourite=, veto= and vote=; what is for the model "
            'needs more words around it, such as "set gain=2".'
        )


def _place(name: str, mark: str) -> Place:
    found = _PLACE.fullmatch(name)
    if found is None:
        raise FeedbackError(f"`{mark}` names no candidate; write g0s3 for slot 3 of generation 0, a vote as g0s3:g0s1.")
    return Place(int(found[1]), int(found[2]))
