"""Searches compared: every arm of a plan on every task, with every seed; what `eureka bench` runs and tells."""
