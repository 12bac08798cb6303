"""The body of a chat completion, parsed without trusting its sender: any bytes give a completion or `Unreadable`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..reward import extract

MAX_TOKENS = 1 << 40
"""Above this a count is nonsense, and would not fit into the store."""
_LIMITS = {"length", "max_tokens", "model_length"}
_FILTERS = {"content_filter", "safety", "recitation"}
_FAULTS = {"error", "abort", "insufficient_system_resource"}  # the last two: vLLM and SGLang, DeepSeek
_CUT = _LIMITS | _FILTERS | _FAULTS
"""Each `finish_reason` of a text that was cut off. Any other counts as a regular end, which endpoints name freely."""

_STREAM = ("data:", "event:", "id:", ":")
"""How a stream of events begins: a line of one of its fields, or a comment."""


@dataclass(frozen=True, slots=True)
class Choice:
    """One of the answers that a request asked for."""

    text: str
    whole: bool
    """Not empty, and not cut off by a limit, a filter or an error before its program ended."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Completion:
    """The answers to one request, and the tokens of all of them together."""

    choices: tuple[Choice, ...]
    model: str
    prompt_tokens: int
    completion_tokens: int


class Unreadable(Exception):
    """There is no completion. `broken`: the answer is damaged or an error, which may pass; else, another protocol."""

    def __init__(self, reason: str, *, broken: bool) -> None:
        super().__init__(reason)
        self.reason, self.broken = reason, broken


def read(body: bytes) -> Completion:
    """The completion that a body holds; fields that are missing or of a wrong type become empty, or zero.

    Bytes that are invalid in the body's encoding become replacement characters: most of a reply is still readable.

    Raises:
        Unreadable: when there is none.
    """
    data = _object(body)
    choices, error = data.get("choices"), data.get("error")
    if error and not choices:  # some endpoints send errors with status 200
        said = error_text(error) or str(error)
        # LM Studio says this to an address without /v1, which another try does not mend.
        raise Unreadable(said, broken="unexpected endpoint" not in said.lower())
    if not isinstance(choices, list):
        raise Unreadable("its answer has no choices", broken=False)
    usage = _mapping(data.get("usage"))
    asked, answered, total = (_count(usage.get(f"{kind}_tokens")) for kind in ("prompt", "completion", "total"))
    model = data.get("model")
    return Completion(
        choices=tuple(map(_choice, choices)),
        model=model if isinstance(model, str) else "",
        prompt_tokens=asked,
        # Gemini and xAI count the tokens of thoughts, which cost money too, only in the total.
        completion_tokens=max(answered, total - asked) if asked else answered,
    )


def error_text(body: object, depth: int = 5) -> str:
    """The text of an error: itself, or a text as `message`, `detail` or `error`, at most `depth` levels down. Gemini
    puts all into a list. FastAPI lists mistakes and quotes the request with each; the quotes are left out, as
    the client looks for words such as "temperature". OpenRouter's own message says nothing: its provider's is in
    `metadata`."""
    if not depth:
        return ""
    if isinstance(body, list):
        return "; ".join(filter(None, (error_text(part, depth - 1) for part in body)))
    if isinstance(body, Mapping):
        if "msg" in body:
            return f"{body.get('loc')}: {body['msg']}"
        raw = _text(_mapping(body.get("metadata")).get("raw"))
        inner = (error_text(body.get(key), depth - 1) for key in ("message", "detail", "error"))
        return raw or next(filter(None, inner), "")
    return body if isinstance(body, str) else ""


def _object(body: bytes) -> Mapping[str, Any]:
    text = body.decode(json.detect_encoding(body), "replace").strip()
    if text.startswith(_STREAM):
        return _streamed(text)
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        raise _no_json(text) from None
    if not isinstance(data, dict):
        raise Unreadable("its answer is not a JSON object", broken=False)
    return data


def _streamed(text: str) -> Mapping[str, Any]:
    """The object that an endpoint would have sent in one, from the events of a stream. A choice without an end is one
    that was cut off by an error."""
    whole: dict[str, Any] = {}
    texts: dict[int, dict[str, list[str]]] = {}
    ends: dict[int, object] = {}
    done = False
    for line in text.split("\n"):  # `splitlines` would also split at characters inside of texts
        field, _, value = line.partition(":")
        if field != "data":
            continue
        done = done or value.strip() == "[DONE]"
        try:
            event = _mapping(json.loads(value))
        except (ValueError, RecursionError):
            continue  # `[DONE]`, or an event that was cut off
        whole.update({key: event[key] for key in ("model", "usage", "error") if event.get(key)})
        pieces = event.get("choices")
        for piece in map(_mapping, pieces if isinstance(pieces, list) else []):
            index = _count(piece.get("index"))
            delta = _mapping(piece.get("delta")) or _mapping(piece.get("message"))
            said = texts.setdefault(index, {"content": [], "refusal": []})
            for kind, parts in said.items():
                parts.append(_text(delta.get(kind)))
            ends[index] = piece.get("finish_reason") or ends.get(index)
    regular = "stop" if done and "error" not in whole else "error"
    whole["choices"] = [
        {
            "message": {kind: "".join(parts) for kind, parts in texts[index].items()},
            "finish_reason": ends[index] or regular,
        }
        for index in sorted(texts)
    ]
    return whole


def _no_json(text: str) -> Unreadable:
    """What an answer is that is not JSON."""
    if text.startswith("<"):
        return Unreadable("its answer is a web page", broken=False)
    if not text or text.startswith("{"):  # what begins like an object and is none was damaged on the way
        return Unreadable("its answer was cut off", broken=True)
    return Unreadable("its answer is not a JSON object", broken=False)


def _choice(choice: object) -> Choice:
    fields = _mapping(choice)
    message = _mapping(fields.get("message"))
    text = _text(message.get("content")) or _text(message.get("refusal")) or _called(message.get("tool_calls"))
    end, _, _ = str(fields.get("finish_reason")).lower().partition(":")  # Gemini: `content_filter: RECITATION`
    return Choice(text, bool(text) and (end not in _CUT or extract.is_settled(text)))


def _text(content: object) -> str:
    """A string, or the text parts that some endpoints send instead."""
    parts = [_mapping(part).get("text") for part in content] if isinstance(content, list) else [content]
    return "".join(part for part in parts if isinstance(part, str))


def _called(calls: object) -> str:
    """The arguments of tool calls: models make them though no tools are offered, often with the program inside."""
    functions = [_mapping(_mapping(call).get("function")) for call in calls] if isinstance(calls, list) else []
    return "\n".join(filter(None, (_text(function.get("arguments")) for function in functions)))


def _mapping(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _count(value: object) -> int:
    return value if isinstance(value, int) and 0 <= value <= MAX_TOKENS else 0
