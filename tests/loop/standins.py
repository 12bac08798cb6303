"""Until the real ones are merged: prompts and extraction of the same signature."""

import re
import sys
import types

from openeureka.types import Message, Prompt, StateSpec, TaskContext


def install() -> None:
    try:
        import openeureka.prompts
    except ImportError:
        prompts = types.ModuleType("openeureka.prompts")
        prompts.render = lambda context, plan, style: Prompt(
            messages=(
                Message("system", context.description),
                *(Message("user", f"{t.sample.candidate.source}\n{t.feedback}") for t in plan.turns),
                *(Message("user", f.feedback) for f in plan.failures),
            )
        )
        prompts.repair = lambda prompt, reply, verdict: Prompt(
            messages=(*prompt.messages, Message("assistant", reply), Message("user", verdict.findings[0].sentence()))
        )
        sys.modules["openeureka.prompts"] = prompts
        import openeureka

        openeureka.prompts = prompts
    try:
        import openeureka.llm.extract
    except ImportError:
        extract = types.ModuleType("openeureka.llm.extract")

        def program(text):
            found = re.search(r"```python\n(.*?)```", text, re.DOTALL)
            return found[1] if found else None

        extract.program = program
        sys.modules["openeureka.llm.extract"] = extract
        import openeureka.llm

        openeureka.llm.extract = extract


install()

CONTEXT = TaskContext(env="toy", description="Do the thing.", state=StateSpec(()), source="")
