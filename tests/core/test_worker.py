import errno
import os
import signal
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import pytest
from processes import ends, running

import openeureka
from openeureka import cores as counted
from openeureka import worker as workers
from openeureka.errors import WorkerError
from openeureka.film.video import NoRenderer, render
from openeureka.worker import (
    Frame,
    Stranger,
    Worker,
    WorkerDied,
    WorkerTimeout,
    environment,
    framed,
    interpreter,
    unframed,
)

HERE = str(Path(__file__).parent)
SOURCE = str(Path(openeureka.__file__).parents[1])


@pytest.fixture
def crowded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Fills the working directory with files named like modules: all of the standard library, some installed ones.
    Each leaves a mark when it is imported."""
    folder = tmp_path / "crowded"
    folder.mkdir()
    for name in {*sys.stdlib_module_names, "torch", "numpy", "pip", "openeureka", "sitecustomize", "usercustomize"}:
        (folder / f"{name}.py").write_text(f"open({str(tmp_path / 'imported')!r}, 'a').write({name!r} + ' ')\n")
    monkeypatch.chdir(folder)
    return tmp_path / "imported"


@pytest.fixture
def worker():
    with Worker("echo_worker", env={"PYTHONPATH": HERE}) as child:
        yield child


@pytest.mark.parametrize("path", [None, "", HERE, f"{HERE}{os.pathsep}", f"{os.pathsep}{os.pathsep}{HERE}"])
def test_no_child_imports_from_the_working_directory(crowded: Path, path: str | None):
    where = {} if path is None else {"PYTHONPATH": path}
    with Worker("runpy" if HERE not in (path or "") else "echo_worker", env=where) as child:
        if HERE in (path or ""):
            child.send({"do": "echo"})
            child.receive()
        child.process.stdin.close()
        child.process.wait()
    assert not crowded.exists(), crowded.read_text()


def test_pip_and_the_runs_of_the_page_do_not_either(crowded: Path):
    for command in (["-m", "pip", "--version"], ["-c", "import openeureka.config, tempfile, glob"]):
        done = subprocess.run([*interpreter(), *command], env=environment(), capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    assert not crowded.exists(), crowded.read_text()


def test_a_child_finds_what_its_parent_finds_after_the_standard_library(tmp_path: Path, monkeypatch):
    """A task may lie beside a script or a notebook, or on PYTHONPATH, which the sandbox's server does not inherit."""
    (tmp_path / "beside_the_script.py").write_text("raise SystemExit(7)\n")
    (tmp_path / "colorsys.py").write_text("raise SystemExit(8)\n")
    monkeypatch.syspath_prepend(tmp_path)
    for module, env, code in (("beside_the_script", None, 7), ("colorsys", None, 0), ("beside_the_script", {}, 7)):
        with Worker(module, env=env) as child:
            assert child.process.wait() == code


@pytest.mark.parametrize(
    ("place", "error", "sentence"),
    [
        (
            "subprocess.Popen",
            OSError(errno.EAGAIN, "not now"),
            r"This machine has run out of .*\(not now\): raise",
        ),
        (
            "tempfile.TemporaryFile",
            FileNotFoundError(errno.ENOENT, "No usable temporary directory found in ['/tmp']"),
            "There is no writable folder for temporary files: set TMPDIR to one.",
        ),
    ],
)
def test_a_machine_without_room_for_a_process_is_one_sentence(place, error, sentence, monkeypatch):
    monkeypatch.setattr(place, Mock(side_effect=error))
    with pytest.raises(WorkerError, match=sentence):
        Worker("echo_worker")
    with pytest.raises(WorkerError, match=sentence):
        Stranger(sys.executable, Path(HERE) / "echo_worker.py", shared=0)
    with pytest.raises(NoRenderer, match="No video. " + sentence):  # a search then writes its report without it
        render("cartpole", "zero")


def test_one_place_says_how_python_is_started():
    """Other modules have to start Python with `interpreter`, so that no child imports from the working directory."""
    named = [
        path.name for path in Path(openeureka.__file__).parent.rglob("*.py") if "sys.executable" in path.read_text()
    ]
    assert named == ["worker.py"]


def test_what_lies_beside_the_package_does_not_hide_the_standard_library(tmp_path: Path):
    """Other packages are installed beside the wheel. Some have the name of a present or former standard module."""
    (tmp_path / "openeureka").symlink_to(Path(SOURCE) / "openeureka")
    (tmp_path / "colorsys.py").write_text("raise SystemExit('imported')\n")
    script = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); from openeureka.worker import Worker\n"
        f"with Worker('colorsys', env={{}}) as w: w.process.wait(); print(w.process.returncode)"
    )
    done = subprocess.run([*interpreter(), "-c", script], capture_output=True, text=True)
    assert done.stdout == "0\n", done.stderr


def test_a_frame_comes_back_with_its_blobs_despite_stray_prints(worker: Worker):
    worker.send({"do": "echo", "text": "ü"}, {"a": b"\x00" * 1_000_000, "b": b""})
    frame = worker.receive()
    assert frame.header == {"do": "echo", "text": "ü"}
    assert frame.blobs == {"a": b"\x00" * 1_000_000, "b": b""}


def test_an_emptied_environment_stays_empty(worker: Worker):
    worker.send({"do": "environment"})
    seen = worker.receive().header["environment"]
    assert set(seen) - {"LC_CTYPE"} == {"PYTHONPATH"}


def grouped() -> bool:
    """Whether the kernel gives each session a share of the processor (sched(7), autogroup)."""
    switch = Path("/proc/sys/kernel/sched_autogroup_enabled")
    return switch.exists() and switch.read_text().strip() == "1"


def test_a_polite_worker_yields_to_this_process():
    with Worker("echo_worker", env={"PYTHONPATH": HERE}, nice=3) as child:
        child.send({"do": "echo"})
        child.receive()
        mine, its = (os.getpriority(os.PRIO_PROCESS, process) for process in (0, child.process.pid))
        group = Path(f"/proc/{child.process.pid}/autogroup")
        assert not group.exists() or group.read_text().endswith(f"nice {min(10, its)}\n")
    assert its == min(19, mine + 3)


@pytest.mark.skipif(not grouped(), reason="this kernel makes no groups of sessions")
@pytest.mark.parametrize(("nice", "expected"), [(0, "nice 10"), (None, "nice 0")])
def test_of_a_polite_process_the_sessions_of_workers_yield_too_unless_somebody_waits(nice: int | None, expected: str):
    script = (
        "import os; from pathlib import Path; os.nice(19); from openeureka.worker import Worker\n"
        f"with Worker('runpy', nice={nice}) as child:\n"
        "    print(Path(f'/proc/{child.process.pid}/autogroup').read_text())"
    )
    done = subprocess.run([*interpreter(), "-c", script], capture_output=True, text=True)
    assert expected in done.stdout, done.stderr


def test_death_is_reported_with_the_last_words(worker: Worker):
    worker.send({"do": "die"})
    with pytest.raises(WorkerDied):
        worker.receive()
    assert worker.stderr_tail() == "last words"


def test_silence_is_a_timeout_and_close_kills(worker: Worker):
    worker.send({"do": "hang"})
    with pytest.raises(WorkerTimeout):
        worker.receive(timeout=0.2)
    worker.close()
    assert worker.process.returncode == -signal.SIGKILL


def test_sigterm_is_the_parents_to_handle_and_ends_what_a_child_starts(worker: Worker):
    """A shutdown, `systemctl stop` and `scancel` send SIGTERM to all processes. A worker has to survive it, because its
    parent still asks for a last snapshot."""
    worker.send({"do": "echo"})
    worker.receive()
    os.kill(worker.process.pid, signal.SIGTERM)
    worker.send({"do": "terminate"})
    assert worker.receive().header == {"codes": [-signal.SIGTERM, -signal.SIGTERM]}


def test_a_frame_that_is_there_can_be_waited_for_without_reading_it(worker: Worker):
    assert not worker.ready(0.0)
    for text in "ab":
        worker.send({"do": "echo", "text": text})
    for text in "ab":  # both may have arrived in one read
        assert worker.ready(3600.0)
        assert worker.receive().header["text"] == text
    assert not worker.ready(0.0)
    worker.send({"do": "die"})
    assert worker.ready(3600.0), "the end of the stream counts as readable, or nobody would notice it"
    with pytest.raises(WorkerDied):
        worker.receive()


def test_garbage_is_refused_before_it_is_read_into_memory(worker: Worker):
    worker.send({"do": "garbage"})
    with pytest.raises(WorkerDied, match="oversized"):
        worker.receive()


def test_a_frame_that_came_another_way_is_the_same_or_refused():
    data = framed({"do": "echo"}, {"a": b"12", "b": b""})
    assert unframed(data) == Frame({"do": "echo"}, {"a": b"12", "b": b""})
    for garbage in (data[:-1], b"", b"\xff" * 40):
        with pytest.raises(WorkerDied):
            unframed(garbage)


def test_what_a_child_that_ended_has_left_running_ends_with_it(worker: Worker):
    worker.send({"do": "leave"})
    left = worker.receive().header["left"]
    with pytest.raises(WorkerDied):
        worker.receive()
    assert (
        worker.ending()
        == "It was killed, often by the kernel when memory runs out: use fewer worlds= or a smaller sample=."
    )
    assert running(left)
    worker.close()
    assert ends(left)
    worker.close()
    assert worker.ending() == ""


def test_a_child_that_somebody_else_reaps_ends_without_a_word(worker: Worker):
    worker.send({"do": "die"})
    with pytest.raises(WorkerDied):
        worker.receive()
    os.waitpid(worker.process.pid, 0)
    assert worker.ending() == ""
    worker.close()


def test_who_reads_from_a_closed_worker_reads_from_no_other_pipe(worker: Worker):
    """One thread may close a worker while another is about to read. Its file descriptor may then be another pipe's."""
    number = worker.fileno()
    worker.close()
    pipes = [os.pipe() for _ in range(4)]
    try:
        assert number in [end for pipe in pipes for end in pipe]
        assert worker.ready(0.0)
        with pytest.raises(WorkerDied):
            worker.receive(timeout=60)
    finally:
        for end in (end for pipe in pipes for end in pipe):
            os.close(end)


def test_what_a_child_prints_is_not_kept_without_end(worker: Worker):
    for number in range(3):
        worker.send({"do": "print", "text": f"{number}" * (workers.MAX_SAID + 1)})
        worker.receive()
        assert os.fstat(worker._stderr.fileno()).st_size <= workers.MAX_SAID
    assert worker.stderr_tail() == ""
    worker.send({"do": "die"})
    with pytest.raises(WorkerDied):
        worker.receive()
    assert worker.stderr_tail() == "last words"  # at the start of the file, with no hole before them


def test_a_process_with_more_descriptors_than_select_takes_starts_workers_too():
    script = (
        "import os, resource; hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]\n"
        "resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))\n"
        "for _ in range(1100): os.dup(0)\n"
        "from openeureka.worker import Worker\n"
        f"with Worker('echo_worker', env={{'PYTHONPATH': {HERE!r}}}) as child:\n"
        "    child.send({'do': 'echo'}); print(child.ready(3600.0), child.receive().header)\n"
    )
    done = subprocess.run([*interpreter(), "-c", script], capture_output=True, text=True)
    assert done.stdout == "True {'do': 'echo'}\n", done.stderr


@pytest.mark.parametrize(
    ("group", "files", "cores"),
    [
        ("0::/\n", {"cpu.max": "150000 100000\n"}, 2),  # docker run --cpus=1.5
        ("0::/\n", {"cpu.max": "max 100000\n"}, 64),
        ("0::/pod/one\n", {"pod/one/cpu.max": "max 100000\n", "pod/cpu.max": "300000 100000\n"}, 3),
        (
            "5:cpu,cpuacct:/docker/a\n0::/\n",
            {"cpu/cpu.cfs_quota_us": "50000\n", "cpu/cpu.cfs_period_us": "100000\n"},
            1,
        ),
        ("1:cpu:/\n", {"cpu/cpu.cfs_quota_us": "-1\n", "cpu/cpu.cfs_period_us": "100000\n"}, 64),
        ("", {}, 64),
    ],
)
def test_cores_are_those_that_the_control_groups_of_a_container_get(group, files, cores, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: set(range(64)))
    monkeypatch.setattr(counted, "CGROUPS", tmp_path)
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    read = Path.read_text
    monkeypatch.setattr(Path, "read_text", lambda file: group if file == Path("/proc/self/cgroup") else read(file))
    assert counted.usable_cores() == cores


def test_the_child_dies_with_its_parent():
    script = (
        f"import sys, os; sys.path[:0] = [{SOURCE!r}]\n"
        "from openeureka.worker import Worker\n"
        f"w = Worker('echo_worker', env={{'PYTHONPATH': {HERE!r}}})\n"
        "w.send({'do': 'echo'}); w.receive()\n"
        "print(w.process.pid, flush=True); os.kill(os.getpid(), 9)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert ends(int(done.stdout))
