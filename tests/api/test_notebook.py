"""The notebook among the examples runs as it stands."""

import json
import subprocess
import sys
from pathlib import Path

import rendering

NOTEBOOK = Path(__file__).parents[2] / "examples" / "notebook.ipynb"


def test_the_notebook_is_kept_without_what_it_printed():
    cells = json.loads(NOTEBOOK.read_text())["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert len(code) == 7
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)


def test_the_notebook_runs_from_its_first_cell_to_its_last(tmp_path):
    cells = json.loads(NOTEBOOK.read_text())["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    code = [cell.replace("seconds=1.0", "seconds=0.1") for cell in code]  # a second takes long to render
    if isinstance(rendering.renderer(), str):
        code.append("assert frames.shape == (3, 720, 1280, 3) and frames.dtype == 'uint8'")
    else:
        code = [cell for cell in code if "run.play" not in cell]
    code.append("assert run.finished and run.report.is_file() and policy([[0.0] * 4] * 3).shape == (3, 1)")
    done = subprocess.run([sys.executable, "-c", "\n".join(code)], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
    assert "def compute_reward(" in done.stdout and "human-s0 baseline" in done.stdout
