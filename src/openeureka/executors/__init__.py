"""Where lanes run: this machine, a Ray cluster, or what `executor=` names."""

from ..plugins import Door

EXECUTORS = Door(
    setting="executor",
    group="openeureka.executors",
    built_in={"local": "openeureka.executors.local:LocalExecutor"},
    members=("train", "evaluate", "rewards"),
)
"""Each is called with `device=`, `threads=` and `snapshots=`, the folder for states of trainings under way, and with
`address=` where that is set, and makes a `types.Trainer`."""

__all__ = ["EXECUTORS"]
