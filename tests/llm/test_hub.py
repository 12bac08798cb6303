"""Downloads from a hub on loopback, which redirects to its storage, gives hashes, resumes, and breaks off when told."""

import errno
import hashlib
import os
import socket
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from huggingface_hub import constants, file_download

from openeureka.errors import ConfigError, ModelError
from openeureka.llm import hub

DATA = b"GGUF" + bytes(range(256)) * 40
SHA = hashlib.sha256(DATA).hexdigest()
NAME = "maker/model-GGUF/model.q4.gguf"


class Hub:
    def __init__(self) -> None:
        self.published = SHA
        self.data = DATA
        self.break_after: int | None = None
        self.ranges: list[str | None] = []
        self.keys: list[str | None] = []
        hub = self

        class Handler(BaseHTTPRequestHandler):
            def do_HEAD(self) -> None:
                self.answer()

            def do_GET(self) -> None:
                self.answer()

            def answer(self) -> None:
                hub.keys.append(self.headers["Authorization"])
                if self.path == "/maker/model-GGUF/resolve/main/model.q4.gguf":
                    self.send_response(302)
                    # To another host, as with real hubs. So the file's size and hash are stated here.
                    self.send_header("Location", f"http://localhost:{hub.server.server_port}/storage")
                    self.send_header("X-Repo-Commit", "0" * 40)
                    self.send_header("X-Linked-Size", str(len(DATA)))
                    self.send_header("X-Linked-ETag", f'"{hub.published}"')
                    self.send_header("Content-Length", "0")
                    self.end_headers()
                elif self.path == "/storage":
                    hub.send(self)
                else:
                    self.send_error(404)

            def log_message(self, *_: object) -> None: ...

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=self.server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()

    def send(self, handler: BaseHTTPRequestHandler) -> None:
        asked = handler.headers["Range"]
        self.ranges.append(asked)
        start = int(asked.removeprefix("bytes=").rstrip("-")) if asked else 0
        handler.send_response(206 if asked else 200)
        handler.send_header("Content-Length", str(len(self.data) - start))
        if asked:
            handler.send_header("Content-Range", f"bytes {start}-{len(self.data) - 1}/{len(self.data)}")
        handler.end_headers()
        handler.wfile.write(self.data[start : self.break_after])
        self.break_after = None


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> Iterator[Hub]:
    made = Hub()
    monkeypatch.setenv("HF_ENDPOINT", f"http://127.0.0.1:{made.server.server_port}/")
    monkeypatch.setattr(file_download.time, "sleep", lambda seconds: None)
    yield made
    made.server.shutdown()
    made.server.server_close()


def left(folder: Path) -> list[str]:
    return [path.name for path in folder.rglob("*") if path.is_file() and path.suffix != ".lock"]


def test_a_file_is_fetched_once_and_nothing_else_is_kept(served: Hub, tmp_path: Path):
    path = hub.fetch(NAME, tmp_path)
    assert path == tmp_path / "maker--model-GGUF" / "model.q4.gguf" and path.read_bytes() == DATA
    assert hub.fetch(NAME, tmp_path) == path and served.ranges == [None]
    assert left(tmp_path) == ["model.q4.gguf"]


def test_no_key_of_the_hub_is_sent(served: Hub, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HF_TOKEN", "hf_canary")
    hub.fetch(NAME, tmp_path)
    assert set(served.keys) == {None}


def test_a_connection_that_breaks_goes_on_where_it_stopped(
    served: Hub, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(constants, "DOWNLOAD_CHUNK_SIZE", 500)  # a break loses the chunk in memory: up to 10 MB
    served.break_after = 1000
    assert hub.fetch(NAME, tmp_path).read_bytes() == DATA
    assert served.ranges == [None, "bytes=1000-"]


def test_what_a_killed_download_left_is_no_obstacle(served: Hub, tmp_path: Path):
    scratch = tmp_path / "maker--model-GGUF" / "model.q4.gguf.download"
    scratch.mkdir(parents=True)
    (scratch / "model.q4.gguf").write_bytes(b"half")
    assert hub.fetch(NAME, tmp_path).read_bytes() == DATA and not scratch.exists()


def test_other_bytes_are_refused_and_removed(served: Hub, tmp_path: Path):
    served.data = DATA[::-1]
    with pytest.raises(ModelError, match=f"does not have the sha256 {SHA[:12]}"):
        hub.fetch(NAME, tmp_path)
    assert left(tmp_path) == []


def test_a_file_of_another_length_than_the_hub_says_is_refused(served: Hub, tmp_path: Path):
    served.data = DATA[:100]
    with pytest.raises(ModelError, match="cannot be fetched"):
        hub.fetch(NAME, tmp_path)
    assert left(tmp_path) == []


def test_a_stated_hash_must_hold_and_replaces_one_the_hub_does_not_give(served: Hub, tmp_path: Path):
    with pytest.raises(ModelError, match="does not have the sha256"):
        hub.fetch(f"{NAME}@{'1' * 64}", tmp_path)
    served.published = "no-hash"
    with pytest.raises(ModelError, match="append @SHA256"):
        hub.fetch(NAME, tmp_path)
    assert hub.fetch(f"{NAME}@{SHA}", tmp_path).read_bytes() == DATA


def test_a_hash_that_is_stated_later_is_not_taken_to_hold_of_what_is_there(served: Hub, tmp_path: Path):
    hub.fetch(NAME, tmp_path)
    with pytest.raises(ModelError, match="does not have the sha256"):
        hub.fetch(f"{NAME}@{'1' * 64}", tmp_path)
    pinned = hub.fetch(f"{NAME}@{SHA}", tmp_path)
    assert pinned == hub.fetch(f"{NAME}@{SHA}", tmp_path) != hub.fetch(NAME, tmp_path)


def test_an_unknown_file_is_one_sentence(served: Hub, tmp_path: Path):
    with pytest.raises(ModelError, match=r"404 .*check the name"):
        hub.fetch("maker/other/model.gguf", tmp_path)


@pytest.mark.parametrize("endpoint", ["hub.invalid", "http://hub:port"])
def test_an_address_of_a_hub_that_is_none_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, endpoint: str
):
    monkeypatch.setenv("HF_ENDPOINT", endpoint)
    with pytest.raises(ModelError, match="cannot be fetched"):
        hub.fetch(NAME, tmp_path)


def test_a_hub_out_of_reach_is_one_sentence(served: Hub, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))  # nobody else gets this port, and nobody listens
        monkeypatch.setenv("HF_ENDPOINT", f"http://127.0.0.1:{bound.getsockname()[1]}/")
        with pytest.raises(ModelError, match="cannot be fetched"):
            hub.fetch(NAME, tmp_path)


@pytest.mark.parametrize("code", ["ENOSPC", "EACCES"])
def test_a_disk_that_takes_no_more_is_one_sentence(
    served: Hub, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str
):
    def failing(*_: object) -> None:
        raise OSError(getattr(errno, code), "the disk")

    monkeypatch.setattr(os, "replace", failing)
    with pytest.raises(ModelError, match="set EUREKA_CACHE"):
        hub.fetch(NAME, tmp_path)


@pytest.mark.parametrize(
    "name",
    [
        *("model.gguf", "a/b/c.bin", "a/b/../../c.gguf", "https://x/y/z.gguf", "a/b/c.gguf@12"),
        *("a/b--c/d.gguf", "a/b.git/c.gguf", "-a/b/c.gguf"),
    ],
)
def test_other_names_are_refused(name: str, tmp_path: Path):
    with pytest.raises(ConfigError, match="local:hub:OWNER/REPO"):
        hub.fetch(name, tmp_path)
