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
from . import completion, connection
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

_PASSING = {408, 409, 425, 429}
"""Client errors that may pass: timeout, conflict, too early, too many requests (RFC 9110, RFC 8470, RFC 6585)."""
_MAY_REFUSE = {500, 501}
"""Server errors that may be refusals: llama.cpp sends 500 for `n` above 1 and for roles that a template lacks."""
_REFUSED = "{where} refuses the request ({said}); fix that, then resume."
_OVERFLOWS = (
    "{where} cannot read a prompt this long ({said}); serve the model with a longer context, or start a run with "
    "another model."
)
_REFUSALS = {
    # Without {said}: the endpoint may quote a part of the key.
    401: "{where} refused the key; set the environment variable OPENAI_API_KEY to a valid one, or, if that is a proxy "
    "such as LiteLLM, check the key that it uses.",
    403: "{where} refuses access ({said}); check what the key in OPENAI_API_KEY may do there.",
    404: "{where} has no model `{model}` for you ({said}); check model= and base_url (which often ends in /v1).",
}
_UNKNOWN = re.compile(r"model not exist|not a valid model|invalid model(?: name|:)", re.IGNORECASE)
"""What DeepSeek, OpenRouter, Mistral and LiteLLM say with 400 in place of 404."""
_TOO_LONG = re.compile(
    r"context[ _](?:length|size|window|limit)|maximum number of tokens|prompt is too long|`inputs` (?:tokens|must)",
    re.IGNORECASE,
)
"""What servers say of a prompt that exceeds the model's context; few have a code for it."""
_SPENT = re.compile(r"insufficient_?quota|exceeded your current quota.{0,200}openai\.com", re.IGNORECASE)
"""LiteLLM drops the code of OpenAI's error and keeps its words. Gemini begins a limit of the minute with the same ones,
so the address that follows decides."""
_SHORTEST_SECRET = 8
"""Characters from which on a key is hidden in texts; keys for servers that need none are words such as `ollama`."""
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
        self._key = connection.api_key(base_url)
        self._client = connection.client(self._key, base_url, TIMEOUT)
        self._where = connection.shown(str(self._client.base_url))
        self._detour = connection.detour(str(self._client.base_url))
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
                            self._warn("%s cuts replies off: raise its token limit or its context length.", self._where)
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
                    raise self._unreadable(error) from None
                self._pause(connection.delay({}, attempt), gone)
            except openai.APIError as error:
                took = time.monotonic() - began
                silences += _is_silence(error) or (took >= GATEWAY and _has_waited(error))
                if not self._adapted(error, n, manner, attempt):
                    last = last or silences == SILENCES or took >= PATIENCE
                    if last or not self._passing(error, attempt):
                        raise self._explained(error) from None
                    headers = error.response.headers if isinstance(error, openai.APIStatusError) else {}
                    self._pause(connection.delay(headers, attempt, error.body), gone)
            else:
                return self._replies_of(prompt, answer, n, time.monotonic() - began)
        raise ModelError(f"{self._where} accepts no request for {self.name}; choose another model.")

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
        said = _said(error).lower()
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

    def _passing(self, error: openai.APIError, attempt: int) -> bool:
        """Whether waiting may help."""
        if _is_spent(error):
            return False
        if isinstance(error, openai.APIConnectionError) and not self._reached and not _is_silence(error):
            return attempt == 0  # more likely a mistake in base_url than an interruption
        if isinstance(error, openai.APIStatusError):
            return error.status_code in _PASSING or error.status_code >= 500
        return isinstance(error, openai.APIConnectionError)

    def _explained(self, error: openai.APIError) -> ModelError:
        where = self._where
        if _is_silence(error):
            return ModelError(
                f"{where} did not answer: it has {TIMEOUT:.0f} s for a sign of life, and {PATIENCE:.0f} s in all. "
                "Resume later, or start a run with a smaller sample= or a faster model. The request may be billed."
            )
        if isinstance(error, openai.APIConnectionError):
            if self._reached:
                return ModelError(f"The connection to {where} broke off; try again.{self._detour}")
            cause = str(error.__cause__) or "no reason given"
            check = "base_url and the network"
            if "CERTIFICATE_VERIFY_FAILED" in cause:
                check = "base_url, or set SSL_CERT_FILE to the certificates that you trust"
            elif "WRONG_VERSION_NUMBER" in cause:
                check = "base_url, which may have to begin with http://"
            return ModelError(f"{where} cannot be reached ({self._quoted(cause)}); check {check}.{self._detour}")
        if _is_spent(error):
            said = self._quoted(_said(error))
            return ModelError(
                f"The account at {where}, or one behind it, has no credit left ({said}); add some, then resume."
            )
        if not isinstance(error, openai.APIStatusError) or self._passing(error, 0):
            return self._busy(_said(error))
        if error.response.is_redirect:
            target = connection.base_of(str(error.request.url), error.response.headers.get("location", ""))
            return ModelError(f"{where} redirects requests to {target}; set base_url= to that address if you trust it.")
        said = _said(error)
        status = 404 if error.status_code == 400 and _UNKNOWN.search(said) else error.status_code
        sentence = _REFUSALS.get(status, _OVERFLOWS if _TOO_LONG.search(said) else _REFUSED)
        refused = sentence.format(where=where, model=self.name, said=self._quoted(said))
        return ModelError(refused + self._detour * (error.status_code == 403))  # proxies send it for local addresses

    def _unreadable(self, error: Unreadable) -> ModelError:
        if error.broken:
            return self._busy(error.reason)
        return ModelError(
            f"{self._where} does not answer like an OpenAI-compatible endpoint ({error.reason}); check base_url, which "
            "often ends in /v1."
        )

    def _busy(self, said: str) -> ModelError:
        return ModelError(f"{self._where} cannot answer now ({self._quoted(said)}); resume when it can.{self._detour}")

    def _quoted(self, text: str) -> str:
        """What an endpoint or the network says, for a sentence: one line, cut short, without the key."""
        return self._hidden(" ".join(text.split()))[:300]

    def _hidden(self, text: str) -> str:
        """The text without the key."""
        return text.replace(self._key, "***") if len(self._key) >= _SHORTEST_SECRET else text

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
            model = self._hidden(answer.model) or self.name
            reply = Reply(text=self._hidden(choice.text), model=model, usage=spent, seconds=seconds)
            replies.append((reply, choice.whole))
        return replies

    def _used(self, prompt_tokens: int, completion_tokens: int) -> Usage:
        cost = self._price.of(prompt_tokens, completion_tokens) if self._price is not None else 0.0
        return Usage(prompt_tokens=prompt_tokens, completion_tokens=completion_tokens, cost_usd=cost)

    def _guessed(self, asked: Sequence[Message], text: str) -> Usage:
        """Usage where the endpoint counts no tokens: none of them, and costs guessed from the length of the texts."""
        if self._price is not None:
            self._warn("%s does not count tokens: costs are guessed from the length of its replies.", self._where)
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


def _is_spent(error: openai.APIError) -> bool:
    """Whether there is nothing left to pay with: at OpenAI, or of the budget of a LiteLLM proxy, or behind that."""
    return error.type == "budget_exceeded" or bool(_SPENT.search(f"{error.code} {_said(error)}"))


def _is_silence(error: openai.APIError) -> bool:
    """Whether the request was sent, as far as can be known, and no answer came in time."""
    return isinstance(error, openai.APITimeoutError) and not isinstance(error.__cause__, httpx2.ConnectTimeout)


def _has_waited(error: openai.APIError) -> bool:
    """Whether a gateway gave up waiting for the model; LiteLLM sends 408."""
    return isinstance(error, openai.APIStatusError) and error.status_code in {408, 504, 524}


def _said(error: openai.APIError) -> str:
    """What the endpoint says of an error. The package reads only OpenAI's own form."""
    words = " ".join(completion.error_text(error.body).split())
    message = " ".join(error.message.split())
    known = not words or words.startswith("<") or words in message  # `<` begins a web page
    return message if known else f"{message} - {words}"
