import dataclasses
import io
import subprocess
import sys

from rich.console import Console

from openeureka.config import RunConfig
from openeureka.display import progress
from openeureka.display.live import PlainView, view
from openeureka.display.progress import ProgressLine, by_node
from openeureka.executors.scheduler import JointProgress
from openeureka.types import NodeShare, TrainingProgress, Usage

PROGRESS = TrainingProgress(
    epoch=5, epochs=20, env_steps_per_second=12345.6, fitness={"sparse-s0": 5.0, "[red]": 321.0, "x-s0": None}
)


def test_without_a_terminal_lines_are_plain_and_rare():
    out = io.StringIO()
    line = ProgressLine(Console(file=out, width=200))
    line.show(PROGRESS)
    line.show(PROGRESS)
    assert out.getvalue() == "Training: epoch 5 of 20, 12,346 steps/s, starting; best F: [red] 321, sparse-s0 5\n"


def test_the_time_left_is_that_of_the_training_shown_and_not_of_one_before_it_or_of_epochs_of_another_day(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    line, told = ProgressLine(Console(file=io.StringIO(), width=200)), list[str]()
    for second, epoch in ((100.0, 1), (110.0, 11), (200.0, 2), (204.0, 4)):
        now[0] = second
        told.append(line._sentence(dataclasses.replace(PROGRESS, epoch=epoch)).split(", ")[2].partition(";")[0])
    assert told == ["starting", "9 s left", "starting", "32 s left"]


def test_epochs_that_a_stopped_run_had_done_tell_no_pace(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    joint, errands = JointProgress(2), (object(), object())
    line, told = ProgressLine(Console(file=io.StringIO(), width=200)), list[str]()
    for second, which, epoch in ((100.0, 0, 10), (101.0, 1, 12), (110.0, 0, 11), (111.0, 1, 13)):
        now[0] = second
        part = dataclasses.replace(PROGRESS, epoch=epoch)
        told.append(line._sentence(joint.add(errands[which], part)).split(", ")[2].partition(";")[0])
    # The mean epoch of both trainings took 11 s to grow by one; eight epochs are left.
    assert told == ["starting", "starting", "starting", "1 min 28 s left"]


def test_the_stage_after_one_that_was_resumed_tells_its_own_pace(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    line, told = ProgressLine(Console(file=io.StringIO(), width=200)), list[str]()
    # Two stages of 100 epochs, one epoch per second. The first was resumed at epoch 90.
    for second, epoch, resumed in ((0.0, 90, 90), (10.0, 100, 90), (11.0, 101, 1), (13.0, 103, 1)):
        now[0] = second
        at = dataclasses.replace(PROGRESS, epoch=epoch, epochs=200, resumed=resumed)
        told.append(line._sentence(at).split(", ")[2].partition(";")[0])
    assert told == ["starting", "1 min 40 s left", "starting", "1 min 37 s left"]


def test_the_nodes_of_a_cluster_follow_with_what_each_trains():
    nodes = {
        "beta": NodeShare(lanes=4, env_steps_per_second=2000.4),
        "alp\nha": NodeShare(lanes=8, env_steps_per_second=1e4),
    }
    placed = dataclasses.replace(PROGRESS, nodes=nodes)
    assert by_node(placed) == "alp ha 8 lanes at 10,000 steps/s, beta 4 lanes at 2,000 steps/s"
    out = io.StringIO()
    ProgressLine(Console(file=out, width=300)).show(placed)
    assert out.getvalue().endswith(f"sparse-s0 5; {by_node(placed)}\n")
    assert by_node(PROGRESS) == ""


def test_a_terminal_that_cannot_redraw_is_given_lines():
    out = io.StringIO()
    dumb = Console(file=out, width=200, force_terminal=True, _environ={"TERM": "dumb"})
    with progress.working("Filming", dumb):
        ProgressLine(dumb).show(PROGRESS)
    assert out.getvalue().splitlines()[0] == "Filming" and "epoch 5 of 20" in out.getvalue()
    assert isinstance(view(RunConfig(), Usage(), dumb), PlainView)


def test_a_log_is_no_terminal_whatever_colours_are_asked_for(monkeypatch, capsys):
    for name, value in (("FORCE_COLOR", "1"), ("TTY_COMPATIBLE", "1")):
        monkeypatch.setenv(name, value)
        assert isinstance(view(RunConfig(), Usage()), PlainView)
        with progress.working("Filming"):
            pass
    assert capsys.readouterr().out == "Filming\nFilming\n"


def test_on_a_terminal_the_clock_is_redrawn():
    out = io.StringIO()
    with progress.working("Filming", Console(file=out, width=200, force_terminal=True, _environ={"TERM": "xterm"})):
        pass
    assert "\x1b[?25l" in out.getvalue()  # the cursor was hidden, so a live display ran


def test_work_without_progress_of_its_own_is_said_once_in_a_log_and_timed_on_a_terminal(monkeypatch):
    out = io.StringIO()
    with progress.working("Filming", Console(file=out)):
        pass
    assert out.getvalue() == "Filming\n"
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    clock = progress._Clock("Filming")
    now[0] = 7.0
    assert clock.__rich__().plain == "Filming, 7 s"


def test_who_reads_may_end_before_what_is_printed():
    code = (
        "import sys; from openeureka.display.progress import standard\n"
        "console = standard()\n"
        "for _ in range(3): console.print('x'); print('y', flush=True)\n"
        "print('whole', file=sys.stderr)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as child:
        assert child.stdout is not None and child.stderr is not None
        child.stdout.close()
        assert child.stderr.read() == b"whole\n"
    assert child.returncode == 0
