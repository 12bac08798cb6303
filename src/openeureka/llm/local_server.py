"""The embedded model's own process: loads a GGUF file once and answers batches of samples. Run by `llm.local`.

Arguments: path of the file, samples decoded at once, tokens of context for each, threads.
"""

from __future__ import annotations

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
    import xllamacpp

    params = xllamacpp.CommonParams()
    params.model.path = path
    params.n_parallel = parallel
    params.n_ctx = parallel * context
    params.kv_unified = False
    params.warmup = False
    params.cpuparams.n_threads = threads
    params.cpuparams_batch.n_threads = threads
    return xllamacpp.Server(params)


def complete(server: Any, request: dict[str, Any]) -> dict[str, Any]:
    """Samples that share the prefill of one prompt and are decoded as a batch."""
    began = time.monotonic()
    answer = server.handle_completions(request)
    if "choices" not in answer:
        return {"error": "request", "detail": str(answer.get("error", answer))[:500]}
    return {
        "texts": [choice["text"] for choice in answer["choices"]],
        "finished": [choice.get("finish_reason") == "stop" for choice in answer["choices"]],
        "usage": answer.get("usage", {}),
        "seconds": time.monotonic() - began,
    }


if __name__ == "__main__":
    main(*sys.argv[1:])
