"""Puts the parts of a run together, and hands back what it left: what the command line and Python both call."""
