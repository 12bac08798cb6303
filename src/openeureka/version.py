"""The version, apart from the package that offers everything."""

__version__ = "0.1.0"
