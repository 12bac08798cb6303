"""Reward files, as people write them."""

from __future__ import annotations

from pathlib import Path

from ..errors import RewardFileError, nearest
from ..types import Candidate

OWN = ("human", "sparse")


def read(path: Path) -> Candidate:
    """The program in a file. Raises RewardFileError."""
    try:
        return Candidate.of(path.read_text(encoding="utf-8"))
    except OSError as error:
        meant = nearest(str(path), OWN) if str(path) not in OWN else ""
        known = f"{meant} Where rewards train, {' and '.join(OWN)} are the task's own; here a name is that of a file."
        raise RewardFileError(f"Cannot read the reward file {path}: {error.strerror}.{known}") from None
    except UnicodeDecodeError:
        raise RewardFileError(f"{path} is not a text file; a reward file is Python source in UTF-8.") from None
