"""Models behind an OpenAI-compatible endpoint."""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from queue import SimpleQueue
from threading import Event, Semaphore, Thread
from typing import Any, NamedTuple

import httpx2
import openai

from ..errors import ModelError
from ..types import Message, Prompt, Reply, Style, Usage
from . import completion, connection, failures
from .completion import Completion, Unreadable
from .price import CHARACTERS, Price

ATTEMPTS = 7
"""Tries of one request. The waits between them add up to about a minute, unless the endpoint asks for others."""
SILENCES = 2
"""Tries of one request that may time out: each may be billed, although there are no tokens to count."""
ROUNDS = 3
"""Times that a reply is asked for while it comes back empty or truncated, the first included."""
PARALLEL = 8
TIMEOUT = 600.0
"""[s] to wait for bytes. Answers are seldom streamed: those of a reasoning model may take minutes to the first byte."""
GATEWAY = 30.0
"""[s] after which an error of a gateway that waited counts so: the model was at work, and may be billed."""
PATIENCE = 900.0
"""[s] for a whole answer: some endpoints send blanks while a request waits in their queue."""
MAX_BODY = 64 << 20
"""Bytes that an answer may have."""

_MAY_REFUSE = {500, 501}
"""Server errors that may be refusals: llama.cpp sends 500 for `n` above 1 and for roles that a template lacks."""
_log = logging.getLogger(__name__)

_Answered = tuple[Reply, bool]
"""A reply, and whether it is whole."""


class _Manner(NamedTuple):
    """What requests hold besides the model and the messages, until the endpoint refuses it."""

    temperature: float | None
    system: bool = True
    """Whether the first message may have the role `system`."""
    stream: bool = False
    """Some models answer only so: Qwen's that think, at Alibaba."""


class EndpointModel:
    """Samples with one request where the endpoint knows `n`, else with parallel requests.

    The key comes from the environment variable OPENAI_API_KEY, goes to this endpoint alone and is never stored. If the
    endpoint repeats it, it is removed from replies and messages.

    Args:
        name: of the model, as the endpoint knows it.
        base_url: of the endpoint; empty means OpenAI's.
        price: None where it is not known; costs then count as zero.

    Raises:
        ModelError: no key.
        ConfigError: an address, a proxy or certificates that cannot be used.
    """

    style: Style = "free"

    def __init__(
        self,
        name: str,
        *,
        base_url: str = "",
        temperature: float = 1.0,
        price: Price | None = None,
    ) -> None:
        if price is None:
            _log.warning("The price of %s is not known: its replies count as free. Add price=INPUT,OUTPUT.", name)
        self.name = name
        key = connection.api_key(base_url)
        self._client = connection.client(key, base_url, TIMEOUT)
        address = str(self._client.base_url)
        self._words = failures.Words(connection.shown(address), name, key, connection.detour(address))
        self._manner = _Manner(temperature)
        self._price = price
        self._knows_n = True
        self._reached = False
        self._warned: set[str] = set()

    def sample(self, prompt: Prompt, *, n: int, seed: int) -> Iterator[Reply]:
        """Yield n replies. The seed is not sent: endpoints ignore or refuse it.

        Raises:
            ModelError: the endpoint cannot answer.
        """
        missing, wasted, half = n, Usage(), None
        for turn in range(1, ROUNDS + 1):
            last = turn == ROUNDS
            try:
                for reply, whole in self._round(prompt, missing):
                    if whole or last:  # half a reply may cost a slot, further rounds could cost the run
                        if reply.text and not whole:
                            self._warn(
                                "%s cuts replies off: raise its token limit or its context length.", self._words.where
                            )
                        yield replace(reply, usage=reply.usage + wasted)
                        missing, wasted = missing - 1, Usage()
                    else:
                        wasted, half = wasted + reply.usage, reply
            except (ModelError, KeyboardInterrupt):
                if half is not None and wasted != Usage():  # max_cost counts only what replies carry
                    yield replace(half, usage=wasted)
                raise
            if not missing:
                return

    def close(self) -> None:
        """Holds no memory worth freeing."""

    def _warn(self, text: str, *values: object) -> None:
        """Once, however many requests see it."""
        if text not in self._warned:
            self._warned.add(text)
            _log.warning(text, *values)

    def _round(self, prompt: Prompt, count: int) -> Iterator[_Answered]:
        """`count` replies."""
        if count > 1 and self._knows_n:
            try:
                choices = self._call(prompt, count, Event())
                self._knows_n = len(choices) == count
            except _BatchRefused:
                choices = []
            yield from choices
            count -= len(choices)
        failure: BaseException | None = None
        for answer in self._side_by_side(prompt, count):
            if isinstance(answer, BaseException):
                failure = answer  # raised once the replies that are paid for have been handed over
            else:
                yield from answer
        if failure is not None:
            raise failure

    def _side_by_side(self, prompt: Prompt, count: int) -> Iterator[list[_Answered] | BaseException]:
        """The outcomes of `count` parallel requests, in any order. When the caller stops iterating, no more are sent.

        The threads are daemons: a process that exits would wait for those of a pool, for minutes during a request.
        """
        answers: SimpleQueue[list[_Answered] | BaseException] = SimpleQueue()
        waiting, gone = Semaphore(count), Event()

        def work() -> None:
            while not gone.is_set() and waiting.acquire(blocking=False):
                try:
                    answers.put(self._call(prompt, 1, gone))
                except BaseException as error:
                    answers.put(error)

        for _ in range(min(count, PARALLEL)):
            Thread(target=work, name="openeureka: asks", daemon=True).start()
        try:
            for _ in range(count):
                yield answers.get()
        finally:
            gone.set()

    def _call(self, prompt: Prompt, n: int, gone: Event) -> list[_Answered]:
        """One request, tried again while that may help and `gone` is not set."""
        silences = 0
        for attempt in range(ATTEMPTS):
            if gone.is_set():
                return []
            last = attempt == ATTEMPTS - 1
            began, manner = time.monotonic(), self._manner
            try:
                answer = completion.read(self._post(prompt, n, manner))
            except Unreadable as error:
                if last or not error.broken:
                    raise self._words.unreadable(error) from None
                self._pause(connection.delay({}, attempt), gone)
            except openai.APIError as error:
                took = time.monotonic() - began
                silences += failures.is_silence(error) or (took >= GATEWAY and failures.has_waited(error))
                if not self._adapted(error, n, manner, attempt):
                    last = last or silences == SILENCES or took >= PATIENCE
                    if last or not failures.may_pass(error, attempt, self._reached):
                        raise self._explained(error) from None
                    headers = error.response.headers if isinstance(error, openai.APIStatusError) else {}
                    self._pause(connection.delay(headers, attempt, error.body), gone)
            else:
                return self._replies_of(prompt, answer, n, time.monotonic() - began)
        raise ModelError(f"{self._words.where} accepts no request for {self.name}; choose another model.")

    def _pause(self, seconds: float, gone: Event) -> None:
        gone.wait(seconds)  # ends early when nobody waits for the answer

    def _post(self, prompt: Prompt, n: int, manner: _Manner) -> bytes:
        """The body of the answer. Raises openai.APIError, or Unreadable for one of more than MAX_BODY bytes."""
        until = time.monotonic() + PATIENCE
        body = bytearray()
        create = self._client.chat.completions.with_streaming_response.create
        try:
            with create(**self._arguments(prompt, n, manner)) as response:
                self._reached = True
                for chunk in response.iter_bytes():
                    body += chunk
                    if len(body) > MAX_BODY:
                        raise Unreadable(f"its answer is larger than {MAX_BODY >> 20} MB", broken=False)
                    if time.monotonic() > until:
                        raise openai.APITimeoutError(request=response.http_request)
        except httpx2.HTTPError as error:  # while a body is read, also an error's; the package converts earlier ones
            self._reached = True
            kind = openai.APITimeoutError if isinstance(error, httpx2.TimeoutException) else openai.APIConnectionError
            raise kind(request=error.request) from None
        return bytes(body)

    def _arguments(self, prompt: Prompt, n: int, manner: _Manner) -> dict[str, Any]:
        messages = prompt.messages if manner.system else _without_system(prompt.messages)
        arguments: dict[str, Any] = {
            "model": self.name,
            "messages": [{"role": message.role, "content": message.content} for message in messages],
        }
        if manner.temperature is not None:
            arguments["temperature"] = manner.temperature
        if manner.stream:
            arguments |= {"stream": True, "stream_options": {"include_usage": True}}
        return arguments if n == 1 else {**arguments, "n": n}

    def _adapted(self, error: openai.APIError, n: int, manner: _Manner, attempt: int) -> bool:
        """Whether the next try will be made in another manner than this refused one.

        Raises:
            _BatchRefused: when each reply is to be asked for by itself.
        """
        refused = isinstance(error, openai.BadRequestError | openai.UnprocessableEntityError)
        if not refused and not (isinstance(error, openai.InternalServerError) and error.status_code in _MAY_REFUSE):
            return False
        said = failures.said(error).lower()
        if manner.temperature is not None and "temperature" in said:
            self._warn("%s does not accept temperature=%g: it uses its own.", self.name, manner.temperature)
            self._manner = self._manner._replace(temperature=None)  # reasoning models know only their own
            return True
        if manner.system and "role" in said and ("system" in said or "alternate" in said):
            self._manner = self._manner._replace(system=False)  # templates of Gemma and Mistral have no such role
            return True
        if not manner.stream and re.search(r"\bstream", said):  # a gateway says "upstream"
            self._manner = self._manner._replace(stream=True)
            return True
        if n > 1 and (refused or attempt):
            # Any other fault will show with n = 1. After two server errors `n` may still be known: it stays in use.
            self._knows_n = not refused
            raise _BatchRefused
        return False

    def _explained(self, error: openai.APIError) -> ModelError:
        if not failures.is_silence(error):
            return self._words.of(error, self._reached)
        return ModelError(
            f"{self._words.where} did not answer: it has {TIMEOUT:.0f} s for a sign of life, and {PATIENCE:.0f} s in "
            "all. Resume later, or start a run with a smaller sample= or a faster model. The request may be billed."
        )

    def _replies_of(self, prompt: Prompt, answer: Completion, n: int, seconds: float) -> list[_Answered]:
        """The replies of an answer; an answer without any is one empty reply."""
        choices = answer.choices[:n] or (completion.Choice("", whole=False),)
        counted = answer.completion_tokens or (answer.prompt_tokens and not any(choice.text for choice in choices))
        replies = []
        for index, choice in enumerate(choices):
            first = index == 0  # the prompt is read once for all
            if counted:
                share = _share(answer.completion_tokens, len(choices), index)
                spent = self._used(answer.prompt_tokens if first else 0, share)
            else:
                spent = self._guessed(prompt.messages if first else (), choice.text)
            model = self._words.hidden(answer.model) or self.name
            reply = Reply(text=self._words.hidden(choice.text), model=model, usage=spent, seconds=seconds)
            replies.append((reply, choice.whole))
        return replies

    def _used(self, prompt_tokens: int, completion_tokens: int) -> Usage:
        cost = self._price.of(prompt_tokens, completion_tokens) if self._price is not None else 0.0
        return Usage(prompt_tokens=prompt_tokens, completion_tokens=completion_tokens, cost_usd=cost)

    def _guessed(self, asked: Sequence[Message], text: str) -> Usage:
        """Usage where the endpoint counts no tokens: none of them, and costs guessed from the length of the texts."""
        if self._price is not None:
            self._warn("%s does not count tokens: costs are guessed from the length of its replies.", self._words.where)
        said = sum(len(message.content) for message in asked)
        return Usage(cost_usd=self._used(said // CHARACTERS, len(text) // CHARACTERS).cost_usd)


def _share(total: int, count: int, index: int) -> int:
    """The index-th of `count` nearly equal parts of `total`: endpoints count the tokens of all replies together."""
    return total // count + (index < total % count)


class _BatchRefused(Exception):
    """The endpoint refused a request for several replies."""


def _without_system(messages: Sequence[Message]) -> Sequence[Message]:
    """The messages with that of the system put in front of the next one."""
    first, *rest = messages
    if first.role != "system" or not rest:
        return messages
    asked, *later = rest
    return (Message(asked.role, f"{first.content}\n\n{asked.content}"), *later)
