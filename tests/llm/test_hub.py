"""A loopback hub: redirects to its storage, gives hashes, resumes, and breaks off when told to."""

import hashlib
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from openeureka.errors import ConfigError, ModelError
from openeureka.llm import hub

DATA = b"GGUF" + bytes(range(256)) * 40
SHA = hashlib.sha256(DATA).hexdigest()
NAME = "maker/model-GGUF/model.q4.gguf"


class Hub:
    def __init__(self) -> None:
        self.published: str | None = SHA
        self.break_after: int | None = None
        self.ranges: list[str | None] = []
        hub = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                if self.path == "/maker/model-GGUF/resolve/main/model.q4.gguf":
                    self.send_response(302)
                    self.send_header("Location", "/storage")
                    if hub.published:
                        self.send_header("X-Linked-ETag", f'"{hub.published}"')
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
        if start >= len(DATA):
            handler.send_error(416)
            return
        handler.send_response(206 if asked else 200)
        handler.send_header("Content-Length", str(len(DATA) - start))
        handler.end_headers()
        handler.wfile.write(DATA[start : self.break_after])


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> Iterator[Hub]:
    made = Hub()
    monkeypatch.setenv("HF_ENDPOINT", f"http://127.0.0.1:{made.server.server_port}/")
    yield made
    made.server.shutdown()
    made.server.server_close()


def test_a_file_is_fetched_once(served: Hub, tmp_path: Path):
    path = hub.fetch(NAME, tmp_path)
    assert path == tmp_path / "maker--model-GGUF" / "model.q4.gguf" and path.read_bytes() == DATA
    assert hub.fetch(NAME, tmp_path) == path and served.ranges == [None]


def test_an_interrupted_download_goes_on_where_it_stopped(served: Hub, tmp_path: Path):
    served.break_after = 1000
    with pytest.raises(ModelError, match="run the same command again to go on"):
        hub.fetch(NAME, tmp_path)
    served.break_after = None
    assert hub.fetch(NAME, tmp_path).read_bytes() == DATA
    assert served.ranges == [None, "bytes=1000-"]


def test_a_whole_but_unchecked_file_is_checked(served: Hub, tmp_path: Path):
    part = tmp_path / "maker--model-GGUF" / "model.q4.gguf.part"
    part.parent.mkdir()
    part.write_bytes(DATA)
    assert hub.fetch(NAME, tmp_path).read_bytes() == DATA and not part.exists()


def test_other_bytes_are_refused_and_removed(served: Hub, tmp_path: Path):
    served.published = "0" * 64
    with pytest.raises(ModelError, match="did not give the file with sha256 000000000000"):
        hub.fetch(NAME, tmp_path)
    assert not list(tmp_path.rglob("*.part")) and not list(tmp_path.rglob("*.gguf"))


def test_a_stated_hash_must_hold_and_replaces_one_the_hub_does_not_give(served: Hub, tmp_path: Path):
    with pytest.raises(ModelError, match="did not give the file"):
        hub.fetch(f"{NAME}@{'1' * 64}", tmp_path)
    served.published = None
    with pytest.raises(ModelError, match="append @SHA256"):
        hub.fetch(NAME, tmp_path)
    assert hub.fetch(f"{NAME}@{SHA}", tmp_path).read_bytes() == DATA


def test_an_unknown_file_is_one_sentence(served: Hub, tmp_path: Path):
    with pytest.raises(ModelError, match=r"404 .*check the name"):
        hub.fetch("maker/other/model.gguf", tmp_path)


def test_a_hub_out_of_reach_is_one_sentence(served: Hub, tmp_path: Path):
    served.server.shutdown()
    served.server.server_close()
    with pytest.raises(ModelError, match="cannot be fetched"):
        hub.fetch(NAME, tmp_path)


@pytest.mark.parametrize("name", ["model.gguf", "a/b/c.bin", "a/b/../../c.gguf", "https://x/y/z.gguf", "a/b/c.gguf@12"])
def test_other_names_are_refused(name: str, tmp_path: Path):
    with pytest.raises(ConfigError, match="local:hub:OWNER/REPO"):
        hub.fetch(name, tmp_path)
