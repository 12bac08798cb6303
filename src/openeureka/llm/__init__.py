"""Language models: one protocol, and what `model=` may name."""

from .registry import open_model

__all__ = ["open_model"]
