"""What a failed request to an endpoint means, and the sentence that says what to do."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import httpx2
import openai

from ..errors import ModelError
from . import completion, connection
from .completion import Unreadable

_PASSING = {408, 409, 425, 429}
"""Client errors that may pass: timeout, conflict, too early, too many requests (RFC 9110, RFC 8470, RFC 6585)."""
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
_MEANT = {
    401: re.compile(r"api key not valid", re.IGNORECASE),  # Gemini
    404: re.compile(r"model not exist|not a valid model|invalid model(?: name|:)", re.IGNORECASE),  # DeepSeek, others
}
"""What servers say with 400 in place of these."""
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


def said(error: openai.APIError) -> str:
    """What the endpoint says of an error. The package reads only OpenAI's own form."""
    words = " ".join(completion.error_text(error.body).split())
    message = " ".join(error.message.split())
    known = not words or words.startswith("<") or words in message  # `<` begins a web page
    return message if known else f"{message} - {words}"


def is_silence(error: openai.APIError) -> bool:
    """Whether the request was sent, as far as can be known, and no answer came in time."""
    return isinstance(error, openai.APITimeoutError) and not isinstance(error.__cause__, httpx2.ConnectTimeout)


def has_waited(error: openai.APIError) -> bool:
    """Whether a gateway gave up waiting for the model; LiteLLM sends 408."""
    return isinstance(error, openai.APIStatusError) and error.status_code in {408, 504, 524}


def is_spent(error: openai.APIError) -> bool:
    """Whether there is nothing left to pay with: at OpenAI, or of the budget of a LiteLLM proxy, or behind that."""
    return error.type == "budget_exceeded" or bool(_SPENT.search(f"{error.code} {said(error)}"))


def may_pass(error: openai.APIError, attempt: int, reached: bool) -> bool:
    """Whether waiting may help.

    Args:
        attempt: how many tries came before the one that failed.
        reached: whether the endpoint ever answered.
    """
    if is_spent(error):
        return False
    if isinstance(error, openai.APIConnectionError) and not reached and not is_silence(error):
        return attempt == 0  # more likely a mistake in base_url than an interruption
    if isinstance(error, openai.APIStatusError):
        return error.status_code in _PASSING or error.status_code >= 500
    return isinstance(error, openai.APIConnectionError)


@dataclass(frozen=True)
class Words:
    """Says of one endpoint what failed.

    Attributes:
        where: its address, as it may be shown.
        model: the model's name.
        key: what no sentence may show.
        detour: the proxy that leads there, as `connection.detour` says it.
    """

    where: str
    model: str
    key: str = field(repr=False)
    detour: str

    def of(self, error: openai.APIError, reached: bool) -> ModelError:
        """The sentence for an error other than silence. `reached` says whether the endpoint ever answered."""
        where, told = self.where, said(error)
        if isinstance(error, openai.APIConnectionError):
            return self._cut_off(error, reached)
        if is_spent(error):
            return ModelError(
                f"The account at {where}, or one behind it, has no credit left ({self._quoted(told)}); add some, then "
                "resume."
            )
        if not isinstance(error, openai.APIStatusError) or may_pass(error, 0, reached):
            return self.busy(told)
        if error.response.is_redirect:
            target = connection.base_of(str(error.request.url), error.response.headers.get("location", ""))
            return ModelError(f"{where} redirects requests to {target}; set base_url= to that address if you trust it.")
        status = error.status_code
        if status == 400:
            status = next((meant for meant, words in _MEANT.items() if words.search(told)), status)
        sentence = _REFUSALS.get(status, _OVERFLOWS if _TOO_LONG.search(told) else _REFUSED)
        refused = sentence.format(where=where, model=self.model, said=self._quoted(told))
        return ModelError(refused + self.detour * (error.status_code == 403))  # proxies send it for local addresses

    def _cut_off(self, error: openai.APIConnectionError, reached: bool) -> ModelError:
        if reached:
            return ModelError(f"The connection to {self.where} broke off; try again.{self.detour}")
        cause = str(error.__cause__) or "no reason given"
        check = "base_url and the network"
        if "CERTIFICATE_VERIFY_FAILED" in cause:
            check = "base_url, or set SSL_CERT_FILE to the certificates that you trust"
        elif "WRONG_VERSION_NUMBER" in cause:
            check = "base_url, which may have to begin with http://"
        return ModelError(f"{self.where} cannot be reached ({self._quoted(cause)}); check {check}.{self.detour}")

    def unreadable(self, error: Unreadable) -> ModelError:
        """The sentence for an answer that cannot be read."""
        if error.broken:
            return self.busy(error.reason)
        return ModelError(
            f"{self.where} does not answer like an OpenAI-compatible endpoint ({error.reason}); check base_url, which "
            "often ends in /v1."
        )

    def busy(self, told: str) -> ModelError:
        """The sentence for what may succeed later."""
        return ModelError(f"{self.where} cannot answer now ({self._quoted(told)}); resume when it can.{self.detour}")

    def hidden(self, text: str) -> str:
        """The text without the key."""
        return text.replace(self.key, "***") if len(self.key) >= _SHORTEST_SECRET else text

    def _quoted(self, text: str) -> str:
        """What an endpoint or the network says, for a sentence: one line, cut short, without the key."""
        return self.hidden(" ".join(text.split()))[:300]
