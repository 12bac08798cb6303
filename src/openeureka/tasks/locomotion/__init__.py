"""Ant, Humanoid and Anymal."""
