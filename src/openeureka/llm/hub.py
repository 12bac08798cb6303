"""Fetches a GGUF file by name from a model hub, and checks it before it is used."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from pathlib import Path

from ..errors import ConfigError, ModelError
from . import weights

_NAME = re.compile(r"(?P<repo>[\w.-]+/[\w.-]+)/(?P<file>[\w./-]+\.gguf)(?:@(?P<sha256>[0-9a-f]{64}))?")
_SHA256 = re.compile(r"[0-9a-f]{64}")


def endpoint() -> str:
    """The hub: environment variable `HF_ENDPOINT`, else huggingface.co."""
    return (os.environ.get("HF_ENDPOINT") or "https://huggingface.co").rstrip("/")


def fetch(name: str, folder: Path | None = None) -> Path:
    """The file `OWNER/REPO/FILE.gguf` of a hub, downloaded once into the cache.

    Its sha256 must be the `@SHA256` at the end of the name, else the one that the hub states.

    Raises:
        ConfigError: the name has another form.
        ModelError: the hub cannot be reached, has no such file or no hash of it, or sent other bytes.
    """
    match = parsed(name)
    file = match["file"].replace("/", "--")
    pinned = f"{match['sha256'][:16]}--{file}" if match["sha256"] else file
    target = (folder or weights.cache_dir()) / match["repo"].replace("/", "--") / pinned
    if target.is_file():
        return target
    with weights.exclusive(target):
        if not target.is_file():
            _download(match["repo"], match["file"], target, match["sha256"])
    return target


def parsed(name: str) -> re.Match[str]:
    """The parts of `OWNER/REPO/FILE.gguf`. Raises ConfigError for a name of another form."""
    match = _NAME.fullmatch(name)
    if match is None or ".." in name:
        raise _misnamed(name)
    return match


def _misnamed(name: str) -> ConfigError:
    return ConfigError(f"`{name}` does not name a file of a model hub; write local:hub:OWNER/REPO/FILE.gguf.")


def _download(repo: str, file: str, target: Path, sha256: str | None) -> None:
    os.environ.setdefault("HF_HUB_DISABLE_TELEMETRY", "1")  # read once, when the package is imported
    try:
        import huggingface_hub
        from huggingface_hub.errors import HfHubHTTPError, HFValidationError, XetDownloadError
        from huggingface_hub.utils import disable_progress_bars
    except ImportError:
        raise ModelError("A model hub needs the package huggingface_hub; pip install 'openeureka[local]'.") from None
    import httpx2

    disable_progress_bars()  # they would be drawn over what a search shows
    try:
        url = huggingface_hub.hf_hub_url(repo, file, endpoint=endpoint())
    except HFValidationError:
        raise _misnamed(f"{repo}/{file}") from None
    # Not the target's folder: the library leaves other files where it downloads to.
    scratch = target.with_name(target.name + ".download")
    shutil.rmtree(scratch, ignore_errors=True)
    try:
        published = huggingface_hub.get_hf_file_metadata(url, token=False, endpoint=endpoint()).etag or ""
        expected = sha256 or (published if _SHA256.fullmatch(published) else None)
        if expected is None:
            raise ModelError(f"The hub gives no sha256 for {url}; append @SHA256 to the model's name.")
        got = huggingface_hub.hf_hub_download(repo, file, local_dir=scratch, token=False, endpoint=endpoint())
        with open(got, "rb") as downloaded:
            sent = hashlib.file_digest(downloaded, "sha256").hexdigest()
        if sent != expected:
            raise ModelError(f"The file from {url} does not have the sha256 {expected[:12]}…; try again.")
        os.replace(got, target)
    except HfHubHTTPError as error:
        code, reason = error.response.status_code, error.response.reason_phrase
        raise ModelError(f"The hub refused {url} ({code} {reason}); check the name.") from None
    except (OSError, ImportError, httpx2.HTTPError, httpx2.InvalidURL, XetDownloadError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise weights.disk_error(target, error) from error
        said = " ".join(str(error).split())[:200]
        raise ModelError(f"{url} cannot be fetched ({said}); run the same command again.") from None
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
