"""A warm sandbox judges a usual reward in a small fraction of a second of processor time."""

from __future__ import annotations

import statistics

from reward.honest import ANT, PROGRAMS, recorded

from openeureka.sandbox import confine
from openeureka.sandbox.client import Sandbox
from openeureka.types import Candidate
from sandbox.clock import processor_seconds

TARGET_SECONDS = 0.1
SLACK = 5.0
"""For slower processors."""


def test_a_candidate_is_judged_within_the_target() -> None:
    sources = [source for spec, source in PROGRAMS.values() if spec is ANT]
    with Sandbox(ANT, recorded(ANT), unsafe=not confine.support().complete) as sandbox:
        seconds = []
        for source in sources:
            before = processor_seconds(sandbox)
            verdict = sandbox.check(Candidate.of(source))
            seconds.append(processor_seconds(sandbox) - before)
            assert verdict.accepted, [finding.sentence() for finding in verdict.findings]
    assert statistics.median(seconds) < TARGET_SECONDS * SLACK
