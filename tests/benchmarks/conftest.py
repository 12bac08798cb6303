"""Scripts find each other by their bare names, and tests find them so too."""

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2] / folder) for folder in ("benchmarks", "scripts")]
