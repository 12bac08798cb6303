"""`eureka feedback`: what a person says of a run, as words of a command line or of a line typed while it waits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..errors import FeedbackError
from ..store import say
from ..store.remarks import remark
from ..types import RemarkKind


def feedback(directory: Path, words: Sequence[str]) -> None:
    """Commit the remarks and say what follows."""
    remarks = [remark(word) for word in words]
    if not remarks:
        raise FeedbackError('Say something, for example: eureka feedback DIR "too jerky" favourite=g0s3 go')
    say(directory, *remarks)
    go = any(said.kind is RemarkKind.GO for said in remarks)
    print("The run goes on." if go else "Kept for the next generation; the run goes on when you say `go`.")
