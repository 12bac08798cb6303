"""Fetches a GGUF file by name from a model hub: resumed after an interruption, and checked before it is used."""

from __future__ import annotations

import hashlib
import os
import re
import urllib.error
import urllib.request
from email.message import Message
from pathlib import Path
from typing import IO, Any

from ..errors import ConfigError, ModelError
from . import weights

_NAME = re.compile(r"(?P<repo>[\w.-]+/[\w.-]+)/(?P<file>[\w./-]+\.gguf)(?:@(?P<sha256>[0-9a-f]{64}))?")
_CHUNK = 1 << 20
_TIMEOUT = 60.0  # [s] without a byte


def endpoint() -> str:
    """The hub: environment variable `HF_ENDPOINT`, else huggingface.co."""
    return (os.environ.get("HF_ENDPOINT") or "https://huggingface.co").rstrip("/")


def fetch(name: str, folder: Path | None = None) -> Path:
    """The file `OWNER/REPO/FILE.gguf` of a hub, downloaded once into the cache.

    Its sha256 is what the hub says of it, or the `@SHA256` at the end of the name, which then must hold.

    Raises:
        ConfigError: the name has another form.
        ModelError: the hub cannot be reached, has no such file or no hash of it, or sent other bytes.
    """
    match = _NAME.fullmatch(name)
    if match is None or ".." in name:
        raise ConfigError(f"`{name}` does not name a file of a model hub; write local:hub:OWNER/REPO/FILE.gguf.")
    target = (folder or weights.cache_dir()) / match["repo"].replace("/", "--") / match["file"].replace("/", "--")
    if target.is_file():
        return target
    with weights.exclusive(target):
        if not target.is_file():
            _download(f"{endpoint()}/{match['repo']}/resolve/main/{match['file']}", target, match["sha256"])
    return target


def _download(url: str, target: Path, sha256: str | None) -> None:
    part = target.with_name(target.name + ".part")
    try:
        published = _append(url, part)
        expected = sha256 or published
        if expected is None:
            raise ModelError(f"The hub gives no sha256 for {url}; append @SHA256 to the model's name.")
        if _hash(part) != expected:
            part.unlink()
            raise ModelError(f"{url} did not give the file with sha256 {expected[:12]}…; try again.")
        os.replace(part, target)
    except urllib.error.HTTPError as error:
        raise ModelError(f"The hub refused {url} ({error.code} {error.reason}); check the name.") from None
    except (urllib.error.URLError, TimeoutError, ConnectionError) as error:
        raise ModelError(f"{url} cannot be fetched ({error}); run the same command again to go on with it.") from None
    except OSError as error:
        raise weights.disk_error(target, error) from error


def _append(url: str, part: Path) -> str | None:
    """Bring the partial file to its end; the hash that the hub publishes of the whole, if it does."""
    have = part.stat().st_size if part.exists() else 0
    request = urllib.request.Request(url, headers={"Accept-Encoding": "identity"})
    if have:
        request.add_header("Range", f"bytes={have}-")
    redirects = _Redirects()
    try:
        answer = urllib.request.build_opener(redirects).open(request, timeout=_TIMEOUT)
    except urllib.error.HTTPError as error:
        if error.code != 416:  # nothing left to send: the file was whole, but not yet checked
            raise
        return redirects.sha256 or _published(error.headers)
    with answer, part.open("ab" if answer.status == 206 else "wb") as file:
        while chunk := answer.read(_CHUNK):
            file.write(chunk)
        length = answer.headers.get("Content-Length")
        if length is not None and file.tell() < int(length) + (have if answer.status == 206 else 0):
            raise ConnectionError("the connection ended early")
        return redirects.sha256 or _published(answer.headers)


class _Redirects(urllib.request.HTTPRedirectHandler):
    """Follows redirects, and keeps the hash that the hub attaches to the first one."""

    def __init__(self) -> None:
        self.sha256: str | None = None

    def redirect_request(self, req: Any, fp: IO[bytes], code: int, msg: str, headers: Any, newurl: str) -> Any:
        self.sha256 = self.sha256 or _published(headers)
        return super().redirect_request(req, fp, code, msg, headers, newurl)


def _published(headers: Message) -> str | None:
    for name in ("X-Linked-ETag", "ETag"):
        tag = (headers.get(name) or "").strip('"')
        if re.fullmatch(r"[0-9a-f]{64}", tag):
            return tag
    return None


def _hash(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
