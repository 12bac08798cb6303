"""Until extraction is merged: a stand-in of the same signature, and a task that is only words."""

import re
import sys
import types

import openeureka.llm
from openeureka.types import StateSpec, TaskContext

CONTEXT = TaskContext(env="toy", description="Do the thing.", state=StateSpec(()), source="")

try:
    import openeureka.llm.extract
except ImportError:
    extract = types.ModuleType("openeureka.llm.extract")

    def program(text):
        found = re.search(r"```python\n(.*?)```", text, re.DOTALL)
        return found[1] if found else None

    extract.program = program
    sys.modules["openeureka.llm.extract"] = extract
    openeureka.llm.extract = extract
