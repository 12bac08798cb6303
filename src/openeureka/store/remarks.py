"""What a person says of a run; any process may say something while the run goes on."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from ..errors import FeedbackError
from ..types import Place, Remark
from .store import Store


def say(directory: Path | str, *remarks: Remark) -> None:
    """Commit remarks, all or none, for the next generation that the run asks for.

    Raises:
        FeedbackError: when the run does not wait for a person, is over, or has no such trained candidate.
        StoreError: when there is no run.
    """
    with Store.view(directory) as store:  # an old run must not be migrated while its own process has it
        check(store, remarks)
    with Store.visit(directory) as store:
        store.say(*remarks)


def check(store: Store, remarks: Iterable[Remark]) -> None:
    """Refuse what the run would not hear or could not follow. Raises FeedbackError."""
    config = store.config
    if config.feedback != "human":
        raise FeedbackError(f"The run in {store.directory} does not wait for a person; start one with feedback=human.")
    if store.heard(config.hearings - 1) is not None:
        raise FeedbackError(f"The run in {store.directory} has asked for its last generation; nothing more is heard.")
    trained = {e.sample.place for g in store.history().generations for e in g.entries if e.result is not None}
    for remark in remarks:
        for place in (remark.candidate, remark.over):
            if place is not None and place not in trained:
                raise FeedbackError(f"{place} is no trained candidate of a finished generation; {_known(trained)}.")


def _known(trained: set[Place]) -> str:
    return f"there are {', '.join(map(str, sorted(trained)))}" if trained else "there is none yet"
