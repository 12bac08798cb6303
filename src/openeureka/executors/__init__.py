"""Where lanes run: this machine, a Ray cluster, or what `executor=` names."""

from ..plugins import Door

EXECUTORS = Door(
    setting="executor",
    group="openeureka.executors",
    built_in={"local": "openeureka.executors.local:LocalExecutor"},
    members=("train", "evaluate", "rewards"),
)
"""Each is called with `device=`, `threads=`, `snapshots=` (the folder for states of trainings under way) and, where it
is set, `address=`. It returns a `types.Trainer`."""

__all__ = ["EXECUTORS"]
