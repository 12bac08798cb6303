"""Language models: one protocol, and what `model=` may name."""

from .registry import expect, is_plain, open_model

__all__ = ["expect", "is_plain", "open_model"]
