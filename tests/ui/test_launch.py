"""The page in its own process, as a person starts it, and the run that it starts."""

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import httpx2
import pytest
from filelock import FileLock
from llm.endpoint import Endpoint, failure
from report.scripted import search_in

from openeureka.__main__ import _terminated
from openeureka.errors import ConfigError, EurekaError
from openeureka.store.db import LOCK, LOG
from openeureka.store.directory import is_asked_to_stop
from openeureka.testing.scripted import reply
from openeureka.ui import actions, server

from .serving import visitor

EUREKA = [sys.executable, "-c", "from openeureka.cli.main import main; main()"]


def wait_for(happens: Callable[[], bool], seconds: float = 900.0) -> None:
    end = time.monotonic() + seconds
    while not happens():
        assert time.monotonic() < end, "it never happened"
        time.sleep(0.05)


def test_a_run_outlives_the_page_that_started_it_and_its_log_tells_how_it_goes(tmp_path, monkeypatch):
    endpoint = Endpoint()
    endpoint.script = lambda _: failure(401)
    monkeypatch.setenv("OPENAI_BASE_URL", endpoint.url)
    monkeypatch.setenv("OPENAI_API_KEY", "sk-none")
    page = subprocess.Popen([*EUREKA, "ui", str(tmp_path), "port=0"], stdout=subprocess.PIPE, text=True)
    assert page.stdout is not None
    address = re.fullmatch(r"Open (http://)(eureka:\S{32})@(127\.0\.0\.1:\d+)/open\n", page.stdout.readline())
    assert address is not None
    own = f"{address[1]}{address[3]}"
    login = tuple(address[2].split(":"))
    with httpx2.Client(
        base_url=own, auth=login, headers={"Origin": own}, follow_redirects=True, timeout=None
    ) as client:
        assert client.get("/open").status_code == 200
        form = {"env": "cartpole", "model": "m", "sample": "2", "steps": ""}
        answer = client.post("/start", data=form)
        assert answer.status_code == 200 and "_cartpole</title>" in answer.text
    page.send_signal(signal.SIGINT)
    assert page.wait() == 0
    (directory,) = tmp_path.iterdir()
    wait_for(
        lambda: "refused the key" in (directory / LOG).read_text() and "eureka resume" in (directory / LOG).read_text()
    )
    endpoint.close()


def test_a_started_run_has_the_settings_of_the_form_and_a_session_of_its_own(tmp_path, monkeypatch):
    # Only the start is tested here. A real run would take seconds to import torch.
    monkeypatch.setattr(actions, "_EUREKA", [sys.executable, "-c", "import os, sys; print(os.getsid(0), sys.argv[1:])"])
    form = {
        "env": "ant",
        "model": " random ",
        "sample": "",
        "iteration": "3",
        "video": "",
        "dir": "elsewhere",
        "base_url": "http://x",
    }
    name = actions.Launcher(tmp_path).start(form)
    log = tmp_path / name / LOG
    wait_for(lambda: log.read_text().endswith("\n"))
    session, words = log.read_text().split(" ", 1)
    assert int(session) != os.getsid(0)
    assert words == f"['run', 'env=ant', 'model=random', 'iteration=3', 'dir={tmp_path / name}']\n"


def test_sigterm_stops_a_run_of_the_page_as_ctrl_c_does(monkeypatch):
    monkeypatch.setattr("sys.argv", ["eureka", "--version"])
    before = signal.getsignal(signal.SIGTERM)
    try:
        with pytest.raises(SystemExit):
            exec(actions._EUREKA[-1])
        assert signal.getsignal(signal.SIGTERM) is _terminated
    finally:
        signal.signal(signal.SIGTERM, before)


def test_a_stopped_run_goes_on_and_its_log_grows(tmp_path, monkeypatch):
    monkeypatch.setattr(actions, "_EUREKA", [sys.executable, "-c", "import sys; print(sys.argv[1:])"])
    directory = search_in(tmp_path / "run", [reply(1), reply(2)], iteration=1)
    (directory / LOG).write_text("earlier\n")
    client = visitor(tmp_path)
    assert client.post("/runs/run/resume").headers["location"] == "/runs/run/"
    wait_for(lambda: (directory / LOG).read_text() == f"earlier\n['resume', '{directory}']\n")
    with FileLock(directory / LOCK):
        answer = client.post("/runs/run/resume")
        assert answer.status_code == 400 and "is already running" in answer.text


def test_a_run_that_is_called_like_a_setting_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr(actions, "_EUREKA", [sys.executable, "-c", "import sys; print(sys.argv[1:])"])
    monkeypatch.chdir(tmp_path)
    directory = search_in(Path("lr=3"), [reply(1), reply(2)], iteration=1)
    actions.Launcher(Path()).resume(directory)
    wait_for(lambda: (directory / LOG).read_text() == f"['resume', '{tmp_path}/lr=3']\n")


def test_a_run_that_is_at_work_is_asked_to_stop(tmp_path):
    directory = search_in(tmp_path / "run", [reply(1), reply(2)])
    client = visitor(tmp_path)
    answer = client.post("/runs/run/stop")
    assert answer.status_code == 400 and "so there is nothing to stop" in answer.text
    with FileLock(directory / LOCK):
        assert client.post("/runs/run/stop").headers["location"] == "/runs/run/"
    assert is_asked_to_stop(directory)


@pytest.mark.parametrize(
    ("form", "problem"),
    [
        ({"env": "nowhere.py:Task"}, "is not a task that can be started from here"),
        ({"env": "os:system"}, "is not a task that can be started from here"),
        ({"env": "ant", "sample": "many"}, "`sample=many` does not fit"),
        ({"env": "ant", "video": "<b>"}, "`video` must be one of all, best, none"),
        ({"env": "ant", "device": "tpu"}, "There is no device `tpu`"),
        ({"env": "ant", "model": "rnadom"}, "Did you mean `random`?"),
        ({"env": "ant", "model": "replay:nowhere"}, "is not a model that can be used from here"),
        ({"env": "ant", "model": "local:nowhere.gguf"}, "is not a model that can be used from here"),
        ({"env": "ant", "model": "local:hub:owner/repo/file.gguf"}, "is not a model that can be used from here"),
        ({"env": "ant", "model": "os:system"}, "is not a model that can be used from here"),
        ({"env": "ant", "model": "os.path:exists"}, "is not a model that can be used from here"),
    ],
)
def test_a_form_that_does_not_fit_starts_nothing_and_says_why(tmp_path, form, problem):
    with pytest.raises(EurekaError, match=re.escape(problem)):
        actions.Launcher(tmp_path).start(form)
    answer = visitor(tmp_path).post("/start", data=form)
    assert answer.status_code == 400 and problem in answer.text
    assert not list(tmp_path.iterdir())


def test_a_form_runs_nobodys_file(tmp_path, monkeypatch):
    file, runs = tmp_path / "own.py", tmp_path / "runs"
    runs.mkdir()
    file.write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\ndef make(config): pass\n")
    answer = visitor(runs).post("/start", data={"env": "ant", "model": f"{file}:make"})
    assert answer.status_code == 400 and "use `eureka run`" in answer.text
    assert not (tmp_path / "ran").exists() and not list(runs.iterdir())


def test_a_form_leaves_videos_at_the_default_until_somebody_chooses(tmp_path):
    client = visitor(tmp_path)
    untouched, chosen = client.get("/").text, client.post("/start", data={"model": "rnadom", "video": "all"}).text
    default = '<select name="video"><option value="">default</option>'
    assert default in untouched and "<option selected>all" not in untouched
    assert default in chosen and "<option selected>all" in chosen


def test_what_was_typed_into_a_refused_form_stands_there_still(tmp_path):
    typed = {"env": "ant", "model": "rnadom", "sample": "7", "steps": "5000", "video": "none"}
    answer = visitor(tmp_path).post("/start", data=typed)
    assert answer.status_code == 400
    for written in ('name="env" list="envs" value="ant"', 'value="rnadom"', 'value="7"', 'value="5000"'):
        assert written in answer.text
    assert "<option selected>none" in answer.text


def test_a_page_that_shows_thousands_of_candidates_is_followed(tmp_path):
    with server.listen("127.0.0.1", 0) as listener:
        serving = server.server(tmp_path, "a-token", server.names("127.0.0.1"))
        thread = threading.Thread(target=serving.run, kwargs={"sockets": [listener]}, daemon=True)
        thread.start()
        with socket.create_connection(listener.getsockname(), timeout=900.0) as caller:
            caller.sendall(b"GET /?shown=" + b"0123456789ab," * 20_000 + b" HTTP/1.1\r\nHost: localhost\r\n\r\n")
            assert caller.recv(100).startswith(b"HTTP/1.1 401 ")  # it was read, and refused for the missing token
        serving.should_exit = True
        thread.join()


def test_an_address_that_is_taken_is_said_in_a_sentence(tmp_path):
    with server.listen("127.0.0.1", 0) as taken, pytest.raises(ConfigError, match="port=, where 0 takes a free one"):
        server.listen("127.0.0.1", taken.getsockname()[1])
    with pytest.raises(ConfigError, match="Cannot serve the page at 192.0.2.1:0"):
        server.listen("192.0.2.1", 0)


@pytest.mark.parametrize(("host", "family"), [("0.0.0.0", socket.AF_INET), ("::", socket.AF_INET6)])
def test_an_address_that_means_all_of_this_machine_is_printed_as_one_to_come_by(monkeypatch, host, family):
    class Routed(socket.socket):
        def connect(self, address):
            assert self.family == family

        def getsockname(self):
            return ("192.0.2.7" if family == socket.AF_INET else "2001:db8::7", 1)

    monkeypatch.setattr(socket, "socket", Routed)
    assert server.called(host) == {"0.0.0.0": "192.0.2.7", "::": "[2001:db8::7]"}[host]


def test_a_machine_without_a_network_is_called_by_its_name(monkeypatch):
    class Alone(socket.socket):
        def connect(self, address):
            raise OSError("Network is unreachable")

    monkeypatch.setattr(socket, "socket", Alone)
    monkeypatch.setattr(socket, "gethostname", lambda: "workshop")
    assert server.called("0.0.0.0") == "workshop"
    assert server.called("127.0.0.1") == "127.0.0.1" and server.called("::1") == "[::1]"


def test_only_loopback_names_are_checked_by_name():
    assert server.names("127.0.0.1") == server.names("::1") == ("127.0.0.1", "localhost", "[::1]")
    assert server.names("0.0.0.0") == ("*",)
