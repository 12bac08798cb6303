"""Batched physics."""

from .base import Simulator
from .cpu import CpuSimulator

__all__ = ["CpuSimulator", "Simulator"]
