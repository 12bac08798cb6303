"""Whether this machine renders: a child process has to try it out, which takes seconds."""

from __future__ import annotations

from functools import cache

import pytest

from openeureka.film import video


@cache
def renderer() -> str | video.VideoUnavailable:
    """What renders here, or why nothing does."""
    try:
        return video.renderer()
    except video.VideoUnavailable as error:
        return error


def needed() -> str:
    """What renders here. Where nothing does, the test is skipped."""
    found = renderer()
    if not isinstance(found, str):
        pytest.skip(str(found))
    return found
