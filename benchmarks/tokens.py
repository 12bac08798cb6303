"""How many tokens does a search take at an endpoint? docs/guides/models.md has the answer.

    python benchmarks/tokens.py

It counts the prompts and replies of the searches that are kept in `benchmarks/longer/`, at as many characters a token
as `max_cost=` takes where an endpoint does not count. What a model thinks is not counted.
"""

from collections.abc import Iterator, Sequence

import headline
import longer

from openeureka.llm.price import CHARACTERS
from openeureka.numbers import columns
from openeureka.report.view import RunView
from openeureka.stats import mean

TITLES = ("task", "generation", "its prompt", "each reply, mean")


def rows(env: str, run: RunView) -> Iterator[Sequence[str]]:
    """Tokens of each generation of a search on `env`."""
    for generation in run.generations:
        prompt = sum(len(message.content) for message in generation.prompts[0].messages)
        replies = [len(attempt.reply.text) for slot in generation.candidates for attempt in slot.attempts]
        counts = (round(characters / CHARACTERS) for characters in (prompt, mean(replies) or 0.0))
        yield env, str(generation.index), *(f"{count:,}" for count in counts)


if __name__ == "__main__":
    kept = (file.name.partition(".")[0] for file in sorted(longer.ARCHIVE.glob("*.xz")))
    print(columns([TITLES, *(row for env in kept for row in rows(env, headline.archived_run(env, longer.ARCHIVE)))]))
