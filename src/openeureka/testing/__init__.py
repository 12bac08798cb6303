"""Conformance suites for models, tasks, trainers and searches, and programs that want to do harm."""
