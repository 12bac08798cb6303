from collections.abc import Iterator
from contextlib import nullcontext

import pytest

from openeureka.sandbox.client import Sandbox
from openeureka.tasks.record import record_states
from openeureka.tasks.registry import get


@pytest.fixture(scope="session")
def cartpoles_sandbox() -> Iterator[Sandbox]:
    task = get("cartpole")
    with Sandbox(task.spec, record_states("cartpole"), worlds=task.recipe.worlds) as running:
        yield running


@pytest.fixture
def one_sandbox(cartpoles_sandbox: Sandbox, monkeypatch: pytest.MonkeyPatch) -> Sandbox:
    """Lets commands on Cartpole judge rewards in one real sandbox. It is opened once, because that takes seconds."""
    for place in ("openeureka.runs.rewards", "openeureka.runs.compose"):
        monkeypatch.setattr(f"{place}.Sandbox", lambda *_, **__: nullcontext(cartpoles_sandbox))
    return cartpoles_sandbox
