"""The run directory: one SQLite file of finished work and the files a person wants to open."""

from .db import FILENAME, LOG
from .recover import is_held, is_run, read_config, read_replies
from .remarks import say
from .store import Peak, Store

__all__ = ["FILENAME", "LOG", "Peak", "Store", "is_held", "is_run", "read_config", "read_replies", "say"]
