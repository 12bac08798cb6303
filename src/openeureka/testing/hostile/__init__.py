"""Programs that attack, or merely break the contract, and what must become of each.

`layer` stops a program, or makes it harmless; `code` and `rule` are the verdict of the whole sandbox. Programs that the
gate refuses are also run without the gate: then any verdict is fine, but no harm is allowed.
"""

from .capabilities import CAPABILITIES, INTROSPECTION
from .case import STATE, Hostile, Layer
from .contract import CONTRACT, PURITY
from .resources import RESOURCES

CORPUS: tuple[Hostile, ...] = (*INTROSPECTION, *CAPABILITIES, *RESOURCES, *PURITY, *CONTRACT)

__all__ = ["CORPUS", "STATE", "Hostile", "Layer"]
