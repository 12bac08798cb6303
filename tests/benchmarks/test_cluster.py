"""The part of `cluster.py` that stands in for Ray's actors with a transport of its own."""

import json
import os
import subprocess
import sys
from pathlib import Path

SMALL = """
import json, cluster
cluster.SLOTS, cluster.HOSTS, cluster.DYING, cluster.LANES = 4, 2, 1, 400
print(json.dumps(cluster.scale(True)))
"""


def test_every_lane_has_a_result_although_slots_die() -> None:
    scripts = Path(__file__).parents[2] / "benchmarks"
    places = os.pathsep.join([str(scripts), os.environ.get("PYTHONPATH", "")])
    asked = subprocess.run(
        [sys.executable, "-c", SMALL], env={**os.environ, "PYTHONPATH": places}, stdout=subprocess.PIPE, check=True
    )
    found = json.loads(asked.stdout.splitlines()[-1])
    assert (found["lanes"], found["results"], found["slots_that_died"]) == (20, 20, 2)
