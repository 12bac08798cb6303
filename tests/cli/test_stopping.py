"""Ctrl-C is heard even if nobody reads the output any more."""

import os
import signal
import subprocess
import sys

import pytest

from openeureka.runs import stopping

SCRIPT = """
import os, signal, sys
from openeureka.runs import stopping

sys.stdout.write("begun"); sys.stdout.flush()
sys.stdin.readline()  # by now nobody reads what is printed
try:
    stopping.interrupt(signal.SIGINT, None)
except KeyboardInterrupt:
    print("more", flush=True)
    print("on the way", file=sys.stderr)
"""


def test_ctrl_c_is_heard_where_it_has_ended_who_reads_the_output():
    """In `eureka run | tee log`, the same Ctrl-C ends `tee`, which reads the output."""
    with subprocess.Popen(
        [sys.executable, "-c", SCRIPT], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as child:
        assert child.stdin is not None and child.stdout is not None and child.stderr is not None
        assert os.read(child.stdout.fileno(), 5) == b"begun"
        child.stdout.close()
        child.stdin.write("\n")
        child.stdin.flush()
        assert (child.stderr.read(), child.wait()) == ("on the way\n", 0)


def test_ctrl_c_is_said_where_somebody_reads(capsys):
    with pytest.raises(KeyboardInterrupt):
        stopping.interrupt(signal.SIGINT, None)
    assert capsys.readouterr().out.startswith("Stopping: trainings are being saved")
