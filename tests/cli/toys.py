"""What the tests of commands put in place of a search's parts."""

from __future__ import annotations

from openeureka.testing.scripted import ToyChecker


class ToySandbox(ToyChecker):
    """In place of `sandbox.client.Sandbox`: opened like it, and judges in this process."""

    def __init__(self, *_: object, unsafe: bool, **__: object) -> None:
        super().__init__()
        self.unsafe = unsafe

    def __enter__(self) -> ToySandbox:
        return self

    def __exit__(self, *_: object) -> None: ...
