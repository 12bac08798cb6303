import os
import shutil
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path

import pytest

from openeureka.film import viewer, web
from openeureka.film.stage import Stage
from openeureka.film.viewer import ViewerUnavailable


class EndingStage(Stage):
    """Raises KeyboardInterrupt, as Ctrl-C does, once the test has seen enough."""

    def __init__(self) -> None:
        super().__init__("cartpole", "random", 0)
        self.steps = 0
        self.enough = threading.Event()

    def step(self) -> None:
        super().step()
        self.steps += 1
        if self.enough.is_set():
            raise KeyboardInterrupt


def listening(port: int) -> set[str]:
    """Addresses at which the port is open, in the kernel's hexadecimal form."""
    rows = [line.split() for name in ("tcp", "tcp6") for line in Path(f"/proc/net/{name}").read_text().splitlines()[1:]]
    return {row[1].split(":")[0] for row in rows if row[3] == "0A" and row[1].endswith(f":{port:04X}")}


@pytest.mark.skipif(sys.platform != "linux", reason="reads the kernel's table of sockets")
def test_the_page_is_served_to_this_machine_only_and_the_policy_plays(capfd, monkeypatch):
    ports = list[int]()

    class Viewer(web.LoopbackViewer):
        def __init__(self, *args, **options):
            super().__init__(*args, **options)
            ports.append(self._http_sock.getsockname()[1])

    monkeypatch.setattr(web, "LoopbackViewer", Viewer)
    monkeypatch.setattr(web, "_PATIENCE", 600.0)
    stage = EndingStage()
    start = stage.data.qpos.copy()
    thread = threading.Thread(target=web.page, args=(stage, 0))
    thread.start()
    try:
        while not (ports and listening(ports[0]) and stage.steps > 3):
            assert thread.is_alive()
            time.sleep(0.1)
        (port,) = ports
        assert listening(port) == {"0100007F"}  # 127.0.0.1
        assert b"<html" in urllib.request.urlopen(f"http://127.0.0.1:{port}/").read().lower()
    finally:
        stage.enough.set()
        thread.join()
    assert stage.steps > 3 and (stage.data.qpos != start).any()
    assert listening(port) == set()


def test_a_taken_port_is_one_sentence(capfd):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        with pytest.raises(ViewerUnavailable, match="No page: "):
            web.page(Stage("cartpole", "zero", 0), other.getsockname()[1])


@pytest.mark.skipif(sys.platform != "linux", reason="other systems always have a display")
def test_without_a_display_there_is_none(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert not viewer.has_display()


@pytest.mark.skipif(not shutil.which("Xvfb"), reason="needs a virtual display: apt-get install xvfb libgl1")
def test_a_window_plays_until_it_is_closed():
    code = """
import threading, time, mujoco.viewer
from openeureka.film import viewer
from openeureka.film.stage import Stage
stage, steps, open_window = Stage("cartpole", "random", 0), [], mujoco.viewer.launch_passive
viewer.CLOSING = 600.0
def close(window):
    while len(steps) <= 3:
        time.sleep(0.1)
    threading.Thread(target=time.sleep, args=[1], daemon=True).start()  # as MuJoCo's own, when it is slow to close
    window.close()
def launch(*args, **kwargs):
    window = open_window(*args, **kwargs)
    threading.Thread(target=close, args=[window]).start()
    return window
mujoco.viewer.launch_passive, step = launch, stage.step
stage.step = lambda: (steps.append(1), step())
assert viewer.has_display()
viewer.window(stage)
print(len(steps) > 3, threading.active_count())
"""
    with subprocess.Popen(["Xvfb", "-displayfd", "1", "-screen", "0", "320x240x24"], stdout=subprocess.PIPE) as server:
        assert server.stdout is not None
        display = server.stdout.readline().decode().strip()
        try:
            result = run_in(code, display)
        finally:
            server.terminate()
    assert result.stdout.split() == ["True", "1"], result.stderr


def run_in(code: str, display: str) -> subprocess.CompletedProcess[str]:
    source = str(Path(viewer.__file__).parents[2])
    environment = {**os.environ, "DISPLAY": f":{display}", "PYTHONPATH": source, "LIBGL_ALWAYS_SOFTWARE": "1"}
    return subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
