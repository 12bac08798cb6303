"""Environments: what they share, and one file each."""
