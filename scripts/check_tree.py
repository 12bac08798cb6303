"""Refuses what does not belong in the repository: paths of one machine, addresses of package indexes, large files."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

MAX_BYTES = 500_000
MAX_STORE_BYTES = 1_000_000  # of a finished search, packed; those of all 31 tasks are to stay below 20 MB
MAX_LONGER_BYTES = 1_500_000  # of one with three generations
RULES = {
    # Split literals keep this file from refusing itself.
    "absolute path of a machine": re.compile(r"(?<![\w.~$}])/" + r"(home|Users|root|work|opt)/[\w.-]+"),
    "address of a package index": re.compile(
        r"--(extra-)?index-" + r"url|--find-" + r"links|https?://[^\s/]+/simple\b"
    ),
}


def findings(path: Path) -> list[str]:
    """One line for each broken rule in a file, with its place."""
    data = path.read_bytes()
    stored = MAX_LONGER_BYTES if path.parent.name == "longer" else MAX_STORE_BYTES
    most = stored if str(path).endswith(".sqlite.xz") else MAX_BYTES
    found = [f"{path}: {len(data)} bytes, more than {most}"] if len(data) > most else []
    if b"\0" in data:
        return found
    for number, line in enumerate(data.decode(errors="replace").splitlines(), start=1):
        found += [
            f"{path}:{number}: {rule}: {line.strip()[:100]}" for rule, regex in RULES.items() if regex.search(line)
        ]
    return found


def main() -> int:
    listed = subprocess.run(["git", "ls-files", "-z"], check=True, capture_output=True, text=True).stdout
    broken = [line for name in listed.split("\0") if name and Path(name).is_file() for line in findings(Path(name))]
    print("\n".join(broken) or "check_tree: nothing found")
    return bool(broken)


if __name__ == "__main__":
    sys.exit(main())
