"""A loopback server that plays an endpoint, good or bad; nothing sleeps and nothing leaves the machine."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from openeureka.llm.openai import EndpointModel
from openeureka.types import Message, Prompt, Reply

PROMPT = Prompt(messages=(Message("system", "s" * 40), Message("user", "u" * 40)))
Play = Callable[[BaseHTTPRequestHandler], None]
"""Writes the answer to a request itself, whole or not."""
Answer = tuple[int, dict | list | str, dict[str, str]] | Play


def answer(*texts: str | None, finish: str = "stop") -> Answer:
    """An answer with a choice for each text. It counts 100 prompt tokens and 10 completion tokens a choice."""
    choices = [
        {"index": i, "finish_reason": finish, "message": {"role": "assistant", "content": text}}
        for i, text in enumerate(texts)
    ]
    usage = {"prompt_tokens": 100, "completion_tokens": 10 * len(texts), "total_tokens": 100 + 10 * len(texts)}
    return (
        200,
        {"id": "1", "object": "chat.completion", "created": 1, "model": "m-1", "choices": choices, "usage": usage},
        {},
    )


def failure(status: int, message: str = "no", *, code: str | None = None, **headers: str) -> Answer:
    return status, {"error": {"message": message, "type": "t", "code": code, "param": None}}, headers


def streamed(*events: dict, done: bool = True) -> Answer:
    """An answer in events, as it comes from an endpoint that streams; without `done` its end is missing."""
    lines = [json.dumps(event, ensure_ascii=False) for event in events] + ["[DONE]"] * done
    return 200, "".join(f"data: {line}\n\n" for line in lines), {}


class Endpoint:
    """Answers request by request from `script`, a list or a function of the request's body."""

    def __init__(self) -> None:
        self.script: list[Answer] | Callable[[dict], Answer] = []
        self.bodies: list[dict] = []
        self.keys: list[str] = []
        self.waits: list[float] = []
        endpoint = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
                endpoint.bodies.append(body)
                endpoint.keys.append(self.headers.get("Authorization", ""))
                script = endpoint.script
                play = script(body) if callable(script) else script.pop(0)
                if callable(play):
                    return play(self)
                status, payload, headers = play
                data = (payload if isinstance(payload, str) else json.dumps(payload)).encode()
                self.send_response(status)
                kind = "text/html" if isinstance(payload, str) else "application/json"
                for name, value in {"Content-Type": kind, "Content-Length": str(len(data)), **headers}.items():
                    self.send_header(name.replace("_", "-"), value)
                self.end_headers()
                self.wfile.write(data)

            def log_message(self, format: str, *_: object) -> None: ...

        class Server(ThreadingHTTPServer):
            request_queue_size = 100  # with 5, a connection made while the server is kept waiting takes seconds

        self.server = Server(("127.0.0.1", 0), Handler)
        threading.Thread(target=self.server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()

    def close(self) -> None:
        self.server.shutdown()
        self.server.server_close()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server.server_port}/v1"

    def model(self, *, patient: bool = False, **arguments) -> EndpointModel:
        """Without `patient`, its waits are noted and take no time."""
        made = EndpointModel("m", **{"base_url": self.url, **arguments})
        if not patient:
            made._pause = lambda seconds, gone: self.waits.append(seconds)
        return made


def sample(model: EndpointModel, n: int) -> list[Reply]:
    return list(model.sample(PROMPT, n=n, seed=0))


def texts(replies: list[Reply]) -> list[str]:
    return sorted(reply.text for reply in replies)
