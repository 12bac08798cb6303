"""Reward files, as people write them."""

from __future__ import annotations

from pathlib import Path

from ..errors import RewardFileError
from ..types import Candidate


def read(path: Path) -> Candidate:
    """The program in a file. Raises RewardFileError."""
    try:
        return Candidate.of(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RewardFileError(f"Cannot read the reward file {path}: {error.strerror}.") from None
    except UnicodeDecodeError:
        raise RewardFileError(f"{path} is not a text file; a reward file is Python source in UTF-8.") from None
