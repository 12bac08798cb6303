"""No file or printed line of a run holds a key, and no text from outside controls the terminal or the page."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from llm.endpoint import Endpoint, answer, failure
from toys import ToySandbox, eureka

from openeureka.runs import compose
from openeureka.testing.scripted import ToyTrainer, reply

KEY = "sk-canary-0123456789"
PASSWORD = "canary-password"
SETTINGS = ["env=cartpole", "sample=2", "iteration=2", "seeds=1", "video=none"]
ESCAPES = "\x1b]0;owned\x07\x1b[2J\x9b31m\u202e<script>alert(1)</script>"
DRIVES = {"\x1b", "\x07", "\x9b", "\u202e"}


@pytest.fixture
def endpoint(monkeypatch: pytest.MonkeyPatch) -> Iterator[Endpoint]:
    """An endpoint with a password in its URL and the key in its replies. The rest of the search is pure functions."""
    served = Endpoint()
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    monkeypatch.setenv("OPENAI_BASE_URL", served.url.replace("http://", f"http://user:{PASSWORD}@"))
    monkeypatch.setattr(compose, "Sandbox", ToySandbox)
    monkeypatch.setattr(compose, "record_states", lambda env: {})
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: ToyTrainer())
    served.script = lambda body: answer(*[f"{reply(3.0)} Bearer {KEY} {ESCAPES}"] * body.get("n", 1))
    yield served
    served.close()


def leaking(directory: Path) -> list[str]:
    """Files that hold a secret, in whatever form."""
    files = [path for path in directory.rglob("*") if path.is_file()]
    assert len(files) > 8, "there are enough files to look through"
    secrets = [KEY.encode(), PASSWORD.encode()]
    return [str(path) for path in files if any(secret in path.read_bytes() for secret in secrets)]


def printed(capsys: pytest.CaptureFixture[str]) -> str:
    out, err = capsys.readouterr()
    text = out + err
    assert KEY not in text and PASSWORD not in text
    assert not DRIVES & set(text)
    return text


def test_a_finished_run_a_replayed_one_and_what_is_shown_of_them_hold_no_secret(
    endpoint: Endpoint, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    assert eureka("run", "model=m", *SETTINGS, f"dir={tmp_path}/run") == 0
    assert eureka("run", f"model=replay:{tmp_path}/run", *SETTINGS, f"dir={tmp_path}/again") == 0
    for directory in ("run", "again"):
        assert eureka("show", f"{tmp_path}/{directory}") == 0
        assert eureka("report", f"{tmp_path}/{directory}") == 0
        assert leaking(tmp_path / directory) == []
        page = (tmp_path / directory / "report.html").read_text()
        assert "Bearer ***" in page and page.count("<script") == 1  # the page's own, allowed by its hash
        assert not DRIVES & set(re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL))
    assert "return 3.0" in printed(capsys)
    assert endpoint.keys and set(endpoint.keys) != {""}, "the endpoint itself got a key"


def test_a_failed_run_holds_no_secret_and_its_error_names_none(
    endpoint: Endpoint, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    endpoint.script = [answer(reply(3.0), reply(4.0)), failure(402, f"no credit for {KEY} {ESCAPES}")]
    assert eureka("run", "model=m", *SETTINGS, f"dir={tmp_path}/run") == 3
    assert "no credit for ***" in printed(capsys)
    assert leaking(tmp_path / "run") == []


def test_a_password_in_base_url_is_refused_before_anything_is_written(
    endpoint: Endpoint, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    address = f"https://user:{PASSWORD}@host/v1"
    assert eureka("run", "model=m", f"base_url={address}", *SETTINGS, f"dir={tmp_path}/run") == 2
    assert "must not hold a user name, a password" in printed(capsys)
    assert not (tmp_path / "run").exists()
