"""MuJoCo's web viewer answers its own page only, and loads no files."""

from __future__ import annotations

import queue
import socket
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from mujoco.studio import messages, viewer_handle
from mujoco.studio.web import web_server
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

from openeureka.film import web


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    http = socket.socket()
    http.bind((web.LOOPBACK, 0))
    http.listen()  # so that a client which connects before the thread serves waits
    tcp = web_server.bind_loopback_socket()
    server = web_server.WebServer(http_sock=http, tcp_sock=tcp, mjb_data=b"MODEL", drop_queue=queue.Queue())
    server.start()
    yield http.getsockname()[1]
    server.stop()


def ask(port: int, **headers: str) -> bytes:
    with urlopen(Request(f"http://127.0.0.1:{port}/model", headers=headers)) as answer:
        return answer.read()


def link(port: int, path: str, origin: str) -> ClientConnection:
    return connect(f"ws://127.0.0.1:{port}/{path}?sid=a", additional_headers={"Origin": origin}, compression=None)


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_the_page_reads_the_model(port, name):
    assert ask(port, Host=f"{name}:{port}") == b"MODEL"
    assert ask(port, Host=f"{name}:9000", Origin=f"http://{name}:9000") == b"MODEL"  # ssh -L 9000:localhost:PORT


def test_the_page_follows_the_policy(port):
    with link(port, "state", f"http://127.0.0.1:{port}") as state:
        assert str(state.recv()).startswith("viewers=1")


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://localhost:9000"},  # another server on this machine
        {"Host": "evil.example"},  # DNS rebinding: an outside name that resolves to this machine
        {"Host": "localhost.evil.example:8080"},
        {"Host": ""},
    ],
)
def test_the_pages_of_other_sites_read_nothing(port, headers):
    with pytest.raises(HTTPError, match="403"):
        ask(port, **headers)


@pytest.mark.parametrize("path", ["ui", "state", "drop"])
def test_the_pages_of_other_sites_say_nothing(port, path):
    with pytest.raises(InvalidStatus, match="403"):
        link(port, path, "http://evil.example")


def test_its_own_page_cannot_drop_a_model(port):
    with pytest.raises(InvalidStatus, match="403"):
        link(port, "drop", f"http://127.0.0.1:{port}")


def test_no_file_is_loaded(tmp_path: Path):
    (tmp_path / "a.xml").write_text("<mujoco/>")
    sent: list[object] = []
    endpoint: Any = SimpleNamespace(send_to_viewer=sent.append, close=lambda: None)
    stage: Any = SimpleNamespace()
    handle = viewer_handle.ViewerHandle(endpoint, sim_plugins=[web.Buttons(stage)])
    handle.dispatch(messages.LoadModelEvent(path=str(tmp_path / "a.xml")))
    assert handle.model is None and not sent
