"""Environments of others as tasks: `env=PREFIX:NAME`; each adapter is found by its prefix, in `tasks.registry`."""
