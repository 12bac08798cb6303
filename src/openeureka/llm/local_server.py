"""The embedded model's own process: loads a GGUF file once and answers batches of samples. Run by `llm.local`.

Arguments: path of the file, samples decoded at once, tokens of context for each, threads.
"""

from __future__ import annotations

import importlib
import secrets
import sys
import time
from typing import Any

from ..worker import Channel


def main(path: str, parallel: str, context: str, threads: str) -> None:
    channel = Channel()
    try:
        server = load(path, int(parallel), int(context), int(threads))
    except ImportError as error:
        channel.send({"error": "missing", "detail": str(error)})
        return
    except Exception as error:
        channel.send({"error": "load", "detail": str(error)})
        return
    channel.send({"ready": True})
    while (frame := channel.receive()) is not None:
        channel.send(complete(server, dict(frame.header)))


def load(path: str, parallel: int, context: int, threads: int) -> Any:
    """The llama.cpp server, without its HTTP end."""
    import torch  # noqa: F401 - brings a libgomp, which the wheel of xllamacpp expects and slim images lack

    xllamacpp: Any = importlib.import_module("xllamacpp")
    params = xllamacpp.CommonParams()
    params.model.path = path
    params.n_parallel = parallel
    params.n_ctx = parallel * context
    params.kv_unified = False
    params.warmup = False
    # It also listens on a loopback port that nobody here uses; a key that nobody knows closes it to other users.
    params.api_keys = [secrets.token_hex(32)]
    params.cpuparams.n_threads = threads
    params.cpuparams_batch.n_threads = threads
    return xllamacpp.Server(params)


def complete(server: Any, request: dict[str, Any]) -> dict[str, Any]:
    """Samples that share the prefill of one prompt and are decoded as a batch."""
    began = time.monotonic()
    answer = server.handle_completions(request)
    if "choices" not in answer:
        return {"error": "request", "detail": str(answer.get("error", answer))[:500]}
    texts = [choice["text"] for choice in answer["choices"]]
    # llama.cpp counts the tokens of the first sample only; the others are taken to have as many per character.
    rate = answer["usage"]["completion_tokens"] / max(len(texts[0]), 1)
    return {
        "texts": texts,
        "prompt_tokens": answer["usage"]["prompt_tokens"],
        "completion_tokens": [round(rate * len(text)) for text in texts],
        "seconds": time.monotonic() - began,
    }


if __name__ == "__main__":
    main(*sys.argv[1:])
