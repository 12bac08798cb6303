"""What a notebook shows of a run, a candidate and a reward."""

from pathlib import Path

from openeureka.runs.run import Run
from openeureka.testing.scripted import reply

from .scripted import search_in

ATTACK = "<script>alert(1)</script>"


def test_views_are_small_name_what_was_found_and_run_nothing(tmp_path: Path):
    script = [reply(7), f"{ATTACK}\n```python\ndef compute_reward(x):\n    # {ATTACK}\n    return 9\n```"]
    run = Run(search_in(tmp_path / ATTACK.replace("/", ""), script))
    assert run.best_reward is not None and "return 9" in run.best_reward
    whole = run._repr_html_()
    assert "g0s0" in whole and "g0s1" in whole and "<polyline" in whole
    assert whole.index("g0s1") < whole.index("g0s0")  # the better one first
    shown = [whole, run.candidates[1]._repr_html_(), run.best_reward._repr_html_()]
    for html in shown:
        assert len(html) < 20_000
        assert "<script" not in html and "http" not in html
    assert all("&lt;script&gt;alert" in html for html in shown)
    assert 'class="k">def<' in shown[1]
