"""The run directory: one SQLite file of finished work and the files a person wants to open."""

from .directory import expect_files, has_begun, is_run, look, read_config, read_remarks, read_replies, say
from .hold import is_held
from .stages import StageFiles
from .store import Store

__all__ = [
    "StageFiles",
    "Store",
    "expect_files",
    "has_begun",
    "is_held",
    "is_run",
    "look",
    "read_config",
    "read_remarks",
    "read_replies",
    "say",
]
