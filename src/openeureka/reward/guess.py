"""What the author of an unknown name may have meant. A wrong guess is worse than none: a model follows it."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from typing import Final

from . import surface

MISSPELT = 0.85
"""Least similarity of a misspelt function name to the right one; high, as similar names do different things."""
RENAMED = 0.7
"""Least similarity of a name that a model made up for a variable to its name: `cart_position` for `cart_pos`."""
_WORD = 0.75
_SHORTENED = 3
"""Letters of the shortest word that may stand for a longer one, as `pos` for `position`."""
_EARLIER = frozenset(("before", "last", "old", "prev", "previous"))
_MEANT: Final = {
    "arccosh": "torch.acosh", "arcsinh": "torch.asinh", "arctanh": "torch.atanh", "array": "torch.tensor",
    "degrees": "torch.rad2deg", "expit": "torch.sigmoid", "fabs": "torch.abs", "ger": "torch.outer",
    "power": "torch.pow", "radians": "torch.deg2rad", "vdot": "torch.dot",
    "euler_from_quat": "get_euler_xyz", "quat_to_euler": "get_euler_xyz", "quat_to_euler_xyz": "get_euler_xyz",
    "quaternion_to_euler": "get_euler_xyz", "quat_from_euler": "quat_from_euler_xyz",
    "quat_conj": "quat_conjugate", "quat_inv": "quat_conjugate", "quat_inverse": "quat_conjugate",
    "quat_invert": "quat_conjugate", "quat_multiply": "quat_mul", "quaternion_multiply": "quat_mul",
    "quat_apply_inverse": "quat_rotate_inverse", "quat_rotate_vec": "quat_rotate",
    "quat_rotate_vector": "quat_rotate", "rotate_vector": "quat_rotate", "quat_normalize": "quat_unit",
}  # fmt: skip
"""Names of other libraries, and what they are called here."""
_OTHERS = surface.words("addr erfcx glu isin logcumsumexp short")
"""Functions of torch whose names resemble an allowed one, but which do something else."""
_ELSEWHERE = ("torch", "torch.nn.functional", "torch.linalg")


def instead(name: str) -> str:
    """An allowed function that does the same under another name or in another module: `torch.sigmoid` for `expit`.
    Empty if there is none."""
    name = name.rstrip("_") or name
    if meant := _MEANT.get(name):
        return meant
    if name in surface.ALL_HELPERS:
        return name
    return next((f"{module}.{name}" for module in _ELSEWHERE if name in surface.MODULES[module]), "")


def twin(path: str) -> str | None:
    """What torch calls a function of numpy or math: `torch.exp` for `numpy.exp`; None if torch has no such function."""
    package, _, rest = path.partition(".")
    if package not in ("numpy", "math"):
        return None
    module, _, name = f"torch.{rest}".rpartition(".")
    return f"{module}.{name}" if name in surface.MODULES.get(module, ()) else _MEANT.get(rest)


def misspelt(name: str, known: Iterable[str], likeness: float) -> str:
    """The known name that this one misspells, or shortens word by word; empty if there is none."""
    if name in _OTHERS:
        return ""
    close = difflib.get_close_matches(name, sorted(known), n=5, cutoff=likeness)
    return next((found for found in close if _alike(name, found)), "")


def is_earlier(name: str) -> bool:
    """Whether a name asks for the value of an earlier step."""
    return not _EARLIER.isdisjoint(name.split("_"))


def _alike(a: str, b: str) -> bool:
    """Whether two names agree in every word and number. `goal1` and `goal2` do not, nor `prev_pos` and `pos`."""
    if a[0] != b[0] or re.findall(r"\d+", a) != re.findall(r"\d+", b):
        return False
    words = a.split("_"), b.split("_")
    return a.replace("_", "") == b.replace("_", "") or (len(words[0]) == len(words[1]) and all(map(_is_one, *words)))


def _is_one(a: str, b: str) -> bool:
    """Whether one of two words is a misspelling or a short form of the other."""
    short, long = sorted((a, b), key=len)
    shortened = len(short) >= _SHORTENED and long.startswith(short)
    return shortened or difflib.SequenceMatcher(None, a, b).ratio() >= _WORD
