from . import standins  # noqa: F401
