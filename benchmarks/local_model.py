"""How many samples of a model are programs that could be trained, how different they are, and how long they take.

    python benchmarks/local_model.py env=ant sample=16              # the embedded model
    python benchmarks/local_model.py env=ant sample=16 model=random # its control

Nothing is trained: what the rewards are worth only a search tells (`eureka run env=ant model=local`).
"""

from __future__ import annotations

import ast
import sys
import time

from openeureka import prompts
from openeureka.config import RunConfig, parse
from openeureka.llm import extract, open_model
from openeureka.sandbox.client import Sandbox
from openeureka.tasks.context import context
from openeureka.tasks.record import record_states
from openeureka.types import Candidate, PromptPlan, Verdict


def main(words: list[str]) -> None:
    config = parse(RunConfig, words)
    known = context(config.env)
    model = open_model(config)
    count = config.sample or 16
    prompt = prompts.render(known, PromptPlan(count=count), model.style)

    began = time.monotonic()
    try:
        replies = list(model.sample(prompt, n=count, seed=config.seed))
    finally:
        model.close()
    seconds = time.monotonic() - began

    sources = [source for reply in replies if (source := extract.program(reply.text)) is not None]
    with Sandbox(known.state, record_states(config.env), unsafe=config.unsafe_no_sandbox) as sandbox:
        verdicts = [sandbox.check(Candidate.of(source)) for source in sources]
    for source, verdict in zip(sources, verdicts, strict=True):
        print(f"{source}\n# {verdict.code}{_reasons(verdict)}\n")

    accepted = sum(verdict.accepted for verdict in verdicts)
    tokens = sum(reply.usage.completion_tokens for reply in replies)
    print(f"{config.env}, {config.model}, seed {config.seed}: {accepted} of {count} accepted")
    print(f"{len(set(sources))} texts differ, {len({_code(source) for source in sources})} beyond their comments")
    print(f"{seconds:.0f} s with loading, {seconds / count:.1f} s each, {tokens / count:.0f} tokens each")


def _reasons(verdict: Verdict) -> str:
    return "".join(f"\n# {finding.sentence()}" for finding in verdict.findings)


def _code(source: str) -> str:
    """The program without comments and layout, as far as it parses."""
    try:
        return ast.unparse(ast.parse(source))
    except SyntaxError:
        return source


if __name__ == "__main__":
    main(sys.argv[1:])
