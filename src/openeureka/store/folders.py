"""The folders of a run in which people look for a policy: `best/`, `polished/` and `robust/`."""

from __future__ import annotations

from collections.abc import Collection

from ..types import PEAKS, PolicyId
from . import artifacts
from .db import Database
from .lane_log import LaneLog
from .rows import decode_digest, digest


class Folders:
    """Copies of policies that lanes left. A folder is filled anew when a better policy comes."""

    def __init__(self, database: Database, lanes: LaneLog) -> None:
        self._database = database
        self._lanes = lanes

    def fill(self, folder: str, policy: PolicyId) -> None:
        """Put a copy of a lane's policy into a folder.

        Files that were made from the folder's previous policy (its video, its ONNX file) are deleted before the policy
        is replaced. So each file there is missing or belongs to the policy; nothing depends on file times.
        """
        data, kept = self._lanes.policy(*policy), f"{folder}/policy.safetensors"
        if data is None or artifacts.read(self._database.directory, kept) == data:
            return
        self.clear(folder, but=("reward.py", "policy.safetensors"))
        artifacts.write(self._database.directory, kept, data)

    def clear(self, folder: str, *, but: Collection[str] = ()) -> None:
        """Delete what a folder holds, all but some files."""
        for name in artifacts.names(self._database.directory, folder):
            if name not in but:
                artifacts.remove(self._database.directory, f"{folder}/{name}")

    def held(self, folder: str) -> list[PolicyId]:
        """The policies that a folder holds a copy of: several where policies are equal byte for byte, as those of lanes
        of one seed at their first epoch."""
        data = artifacts.read(self._database.directory, f"{folder}/policy.safetensors")
        if data is None:
            return []
        wanted = digest(data)
        rows = self._database.rows("results")
        return [
            PolicyId(row["lane"], peak)
            for row in rows
            for peak in PEAKS
            if self._database.decoded(decode_digest, row["result"], peak) == wanted
        ]
