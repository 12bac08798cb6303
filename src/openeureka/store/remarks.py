"""A person's remarks on a run: how they are written, and which generation has heard them."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ..errors import FeedbackError, nearest
from ..types import Place, Remark, RemarkKind
from .db import Log
from .rows import decode_remark, encode_remark

_MARK = re.compile(r"(favou?rite|veto|vote)=(.*)")
_MARKS = ("favourite", "favorite", "veto", "vote")
_WORD = re.compile(r"""(?<!\S)(["'])(?P<quoted>.*?)\1(?!\S)|\S+""")
_SETTING = re.compile(r"(\w+)=(\S*)")
_PLACE = re.compile(r"g(\d{1,6})s(\d{1,6})")


class RemarkLog(Log):
    """Remarks in the order in which they were made; each enters the history of one generation, for good."""

    def say(self, *remarks: Remark) -> None:
        """Commit remarks, all or none; they count for the generation that is asked for next."""
        self._database.put("remarks", *map(encode_remark, remarks))

    def all(self) -> tuple[Remark, ...]:
        """All remarks, heard or not."""
        return self._between(0)

    def unheard(self) -> tuple[Remark, ...]:
        """The remarks that no generation has heard yet."""
        return self._between(self._last_heard())

    def hear(self, generation: int) -> tuple[Remark, ...]:
        """Close the remarks on a generation, and return them: those unheard so far are part of its history from now on,
        later ones are not."""
        rows = self._database.rows("remarks", order=("id",))
        self._database.put("heard", {"generation": generation, "remarks": rows[-1]["id"] if rows else 0})
        remarks = self.heard(generation)
        assert remarks is not None
        return remarks

    def heard(self, generation: int) -> tuple[Remark, ...] | None:
        """The remarks that were made after a generation; None while more may be added."""
        row = self._database.row("heard", generation=generation)
        return self._between(self._last_heard(before=generation), row["remarks"]) if row is not None else None

    def _last_heard(self, before: int | None = None) -> int:
        """Id of the last remark that a generation (earlier than `before`) has heard; ids begin with 1."""
        closed = self._database.rows("heard")
        return max((r["remarks"] for r in closed if before is None or r["generation"] < before), default=0)

    def _between(self, after: int, last: int | None = None) -> tuple[Remark, ...]:
        rows = self._database.rows("remarks", order=("id",))
        wanted = [row for row in rows if row["id"] > after and (last is None or row["id"] <= last)]
        return tuple(self._database.decoded(decode_remark, row) for row in wanted)


# --- words and marks -------------------------------------------------------------------------------------------------


def typed(line: str) -> list[Remark]:
    """The remarks of a typed line, whose words are read as in `spoken`; an empty line is `go`. Raises FeedbackError."""
    words = [match["quoted"] if match[1] else match[0] for match in _WORD.finditer(line)]
    return spoken(words or ["go"])


def spoken(words: Sequence[str]) -> list[Remark]:
    """The remarks of a command line, in this order: every mark, every word that contains a blank (it was quoted), all
    other words together as one sentence, and `go` where it is the last word. Raises FeedbackError."""
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
    """Whether a line is more than words for the model: it is `go`, or holds a mark, perhaps a misspelt one."""
    settings = filter(None, map(_SETTING.match, line.split()))
    return _is_go(line.strip()) or any(nearest(setting[1], _MARKS) for setting in settings)


def remark(word: str) -> Remark:
    """The remark that a word is: `go`, `favourite=g0s3`, `veto=g0s1` or `vote=g0s3:g0s1`; all else is for the model.

    Raises:
        FeedbackError: for a mark that names no candidate, and for a word that looks like a mark but is none.
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
    better, _, worse = named.replace(">", ":").partition(":")  # people write : because the shell takes an unquoted >
    if not (better and worse):
        raise FeedbackError(f"`{word}` does not name two candidates. Name the better one first: vote=g0s3:g0s1.")
    if _place(better, word) == _place(worse, word):
        raise FeedbackError(f"`{named}` votes for a candidate over itself; name two, such as g0s3:g0s1.")
    return Remark(kind=kind, place=_place(better, word), over=_place(worse, word))


def _is_go(word: str) -> bool:
    return word.lower() == "go"


def _refuse_unknown_mark(word: str, *, alone: bool = True) -> None:
    """Raises FeedbackError for a misspelt mark: it must not silently become words for the model.

    Args:
        alone: whether the word stands alone. A setting among other words may be meant for the model, unless it is
            nearly a mark.
    """
    setting = _SETTING.match(word)
    if setting is None:
        return
    guess = nearest(setting[1], _MARKS)
    if guess or (alone and setting.end() == len(word)):
        raise FeedbackError(
            f"There is no mark `{setting[1]}=`.{guess} Marks are favourite=, veto= and vote=. If it is for the model, "
            'put more words around it, such as "set gain=2".'
        )


def _place(name: str, mark: str) -> Place:
    found = _PLACE.fullmatch(name)
    if found is None:
        raise FeedbackError(f"`{mark}` names no candidate; write g0s3 for slot 3 of generation 0, or vote=g0s3:g0s1.")
    return Place(int(found[1]), int(found[2]))
