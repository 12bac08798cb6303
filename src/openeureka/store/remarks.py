"""What a person says of a run; any process may say something while the run goes on."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from ..errors import FeedbackError, nearest
from ..types import Place, Remark, RemarkKind
from .store import Store

MARK = re.compile(r"(favou?rite|veto|vote)=(.*)")
_MARKS = ("favourite", "favorite", "veto", "vote")
_SETTING = re.compile(r"(\w+)=(\S*)")
_PLACE = re.compile(r"g(\d{1,6})s(\d{1,6})")


def say(directory: Path | str, *remarks: Remark) -> None:
    """Commit remarks, all or none, for the next generation that the run asks for.

    Raises:
        FeedbackError: when the run does not wait for a person, is over, or has no such trained candidate.
        StoreError: when there is no run.
    """
    with Store.view(directory) as store:  # an old run must not be migrated while its own process has it
        check(store, remarks)
    with Store.visit(directory) as store:
        store.remarks.say(*remarks)


def check(store: Store, remarks: Iterable[Remark]) -> None:
    """Refuse what the run would not hear or could not follow. Raises FeedbackError."""
    config = store.config
    if config.feedback != "human":
        raise FeedbackError(f"The run in {store.directory} does not wait for a person; start one with feedback=human.")
    if store.remarks.heard(config.hearings - 1) is not None:
        raise FeedbackError(f"The run in {store.directory} has asked for its last generation; nothing more is heard.")
    trained = {e.sample.place for g in store.history().generations for e in g.entries if e.result is not None}
    for remark in remarks:
        for place in (remark.candidate, remark.over):
            if place is not None and place not in trained:
                raise FeedbackError(f"{place} is no trained candidate of a finished generation; {_known(trained)}.")


def _known(trained: set[Place]) -> str:
    return f"there are {', '.join(map(str, sorted(trained)))}" if trained else "there is none yet"


def remark(word: str) -> Remark:
    """`go`, `favourite=g0s3`, `veto=g0s1`, `vote=g0s3:g0s1`, and everything else are words for the model.

    Raises:
        FeedbackError: for a mark that names no candidate, and for what looks like a mark and is none.
    """
    if word == "go":
        return Remark(kind=RemarkKind.GO)
    mark = MARK.fullmatch(word)
    if mark is None:
        _refuse_unknown_mark(word)
        return Remark(kind=RemarkKind.WORDS, text=word)
    kind, named = RemarkKind(mark[1].replace("favorite", "favourite")), mark[2]
    if kind is not RemarkKind.VOTE:
        return Remark(kind=kind, candidate=_place(named))
    better, _, worse = named.replace(">", ":").partition(":")  # an unquoted > is the shell's
    return Remark(kind=kind, candidate=_place(better), over=_place(worse))


def _refuse_unknown_mark(word: str) -> None:
    """What was meant for the run must not silently become words for the model."""
    setting = _SETTING.match(word)
    if setting is None:
        return
    guess = nearest(setting[1].lower(), _MARKS)
    if guess or setting.end() == len(word):
        raise FeedbackError(
            f"There is no `{setting[1]}=` to say.{guess} Marks are favourite=, veto= and vote=; what is for the model "
            'needs more words around it, such as "set gain=2".'
        )


def _place(name: str) -> Place:
    found = _PLACE.fullmatch(name)
    if found is None:
        raise FeedbackError(f"`{name}` names no candidate; write g0s3 for slot 3 of generation 0, a vote as g0s3:g0s1.")
    return Place(int(found[1]), int(found[2]))
