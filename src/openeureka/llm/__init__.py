"""Language models: one protocol, and what `model=` may name."""

from .registry import expect, open_model

__all__ = ["expect", "open_model"]
