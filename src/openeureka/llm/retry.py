"""How long to wait before a request is sent again."""

from __future__ import annotations

import math
from collections.abc import Mapping
from email.utils import parsedate_to_datetime

MAX_WAIT = 120.0  # [s]


def delay(headers: Mapping[str, str], attempt: int) -> float:
    """Seconds to wait after the attempt: what the endpoint says, else 1, 2, 4, ..."""
    stated = _stated(headers)
    return min(2.0**attempt if stated is None else max(stated, 0.0), MAX_WAIT)


def _stated(headers: Mapping[str, str]) -> float | None:
    """Seconds of a `Retry-After` header, which is a number or a date (RFC 9110, 10.2.3)."""
    value = headers.get("retry-after", "")
    try:
        seconds = float(value)
    except ValueError:
        try:
            # By the endpoint's own clock: this machine's may be wrong.
            seconds = (parsedate_to_datetime(value) - parsedate_to_datetime(headers["date"])).total_seconds()
        except (KeyError, ValueError, TypeError):
            return None
    return None if math.isnan(seconds) else seconds
