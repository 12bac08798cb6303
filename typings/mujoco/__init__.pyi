# mujoco ships no type information for its compiled half; everything in it is Any.
from typing import Any

def __getattr__(name: str) -> Any: ...
