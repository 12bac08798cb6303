"""`eureka check`."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence

from ..config import parse
from ..reward.extract import in_file
from ..runs.rewards import MEANINGS, explain, judge
from .settings import CheckConfig, only_path, split


def check(words: Sequence[str], *, as_json: bool = False) -> int:
    """Print the verdict on one reward file; returns 1 when it was refused."""
    settings, paths = split(words)
    config = parse(CheckConfig, settings)
    path = only_path(paths, "eureka check env=cartpole my_reward.py")
    candidate, note = in_file(path)
    (verdict,) = judge(config.env, [candidate], unsafe=config.unsafe_no_sandbox)
    if as_json:
        findings = [dataclasses.asdict(finding) for finding in verdict.findings]
        components = [name for name, _ in verdict.graph.components] if verdict.graph is not None else []
        print(json.dumps({"verdict": verdict.code, "findings": findings, "components": components}, indent=2))
        return 0 if verdict.accepted else 1
    head = f"{path}: {verdict.code} ({MEANINGS[verdict.code]})"
    print("\n".join((*([note] if note else []), head, *explain(verdict, candidate.source))))
    return 0 if verdict.accepted else 1
