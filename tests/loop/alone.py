"""A search without a listener and without a person to ask, unless a test passes them, and what may end it."""

from openeureka import loop
from openeureka.config import RunConfig
from openeureka.events import Tell, nobody
from openeureka.llm.client import LanguageModel
from openeureka.method.person import Desk
from openeureka.method.sampling import Checker
from openeureka.score import Outcome
from openeureka.store import Store
from openeureka.strategies import SearchStrategy
from openeureka.testing.scripted import ToyDesk
from openeureka.types import TaskContext, Trainer


class Killed(BaseException):
    """Stands for the end of the process."""


def run(
    config: RunConfig,
    store: Store,
    model: LanguageModel,
    checker: Checker,
    trainer: Trainer,
    context: TaskContext,
    strategy: SearchStrategy,
    tell: Tell = nobody,
    desk: Desk | None = None,
) -> Outcome:
    return loop.run(config, store, model, checker, trainer, context, strategy, tell, desk or ToyDesk())
