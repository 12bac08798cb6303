"""Types of the numbers and names in nouns. JSON allows other values; `codec` refuses those."""

from __future__ import annotations

import sys
from typing import Annotated

from msgspec import Meta

Finite = Annotated[float, Meta(ge=-sys.float_info.max, le=sys.float_info.max)]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Count = Annotated[int, Meta(ge=0, lt=2**53)]
Positive = Annotated[int, Meta(gt=0, lt=2**53)]
Name = Annotated[str, Meta(pattern=r"\A[^\ud800-\udfff]*\Z")]
"""Text without lone surrogates: every file format can hold it."""
FileName = Annotated[str, Meta(pattern=r"\A[A-Za-z0-9_]*\Z")]
