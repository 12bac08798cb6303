"""Puts the scripts' folders on the path: scripts import each other by bare name, and so do the tests."""

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2] / folder) for folder in ("benchmarks", "scripts")]
