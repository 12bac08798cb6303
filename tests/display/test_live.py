import io
import time
from dataclasses import replace

import pytest
from rich.console import Console

from openeureka.config import RunConfig
from openeureka.display import live
from openeureka.display.live import PlainView, TerminalView, view
from openeureka.display.tally import Tally
from openeureka.events import Asked, Began, Checked, Played, Replied
from openeureka.types import (
    Candidate,
    Evaluation,
    Finding,
    Generation,
    Reply,
    Sample,
    Scored,
    TrainingProgress,
    TrainingResult,
    TrainingState,
    Usage,
    Verdict,
    VerdictCode,
)

CONFIG = RunConfig(env="cartpole", sample=2, iteration=2)
PROGRAM = Candidate.of("good")
ACCEPTED = Sample(
    generation=0, slot=0, candidate=PROGRAM, verdict=Verdict(candidate=PROGRAM.id, code=VerdictCode.ACCEPTED)
)
HOSTILE = Finding(rule="unknown-input", message="[bold]x[/bold]\x1b[2J\x1b]0;title\x07\u202e", line=1)
REFUSED = Sample(
    generation=0,
    slot=1,
    candidate=Candidate.of("bad"),
    verdict=Verdict(candidate="bad", code=VerdictCode.REFUSED, findings=(HOSTILE,)),
    attempts=3,
)
LANE = f"{PROGRAM.id}-s0"
RESULT = TrainingResult(lane=LANE, state=TrainingState.FINISHED, fitness=321.0, curves={}, env_steps=1, seconds=1.0)

PLAYED = Evaluation(lane=LANE, fitness=300.0, error=12.0, episode_length=300.0, episodes=64)


def play(shown: PlainView | TerminalView) -> None:
    """One generation, as the loop reports it."""
    shown(Began("sample", 0))
    shown(Replied(0, Reply(text="x", model="m", usage=Usage(prompt_tokens=1000, completion_tokens=234))))
    shown(Checked(ACCEPTED))
    shown(Checked(REFUSED))
    shown(Began("train", 0))
    shown(TrainingProgress(epoch=1, epochs=4, env_steps_per_second=5000.0, fitness={LANE: 12.5}))
    shown(RESULT)
    shown(Played({LANE: PLAYED}))
    entries = (
        Scored(sample=ACCEPTED, result=RESULT, feedback="", played=PLAYED),
        Scored(sample=REFUSED, result=None, feedback=""),
    )
    shown(Generation(0, entries))


def plain_text() -> str:
    out = io.StringIO()
    with view(CONFIG, Usage(), Console(file=out, width=60)) as shown:
        assert isinstance(shown, PlainView)
        play(shown)
    return out.getvalue()


def terminal_text(width: int = 160) -> str:
    console = Console(file=io.StringIO(), force_terminal=True, width=width, height=50)
    with view(CONFIG, Usage(prompt_tokens=100), console) as shown:
        assert isinstance(shown, TerminalView)
        play(shown)
        frame = Console(file=io.StringIO(), width=width)
        frame.print(shown.render())
    assert isinstance(frame.file, io.StringIO)
    return frame.file.getvalue()


def test_plain_lines_tell_the_story_of_a_generation():
    lines = plain_text().splitlines()
    assert lines[0].startswith("cartpole · generation 0 (0 to 1) · asking the model")
    assert f"  slot 0, try 1, {PROGRAM.id}: accepted" in lines
    assert any(line.startswith("Training: epoch 1 of 4, 5,000 steps/s") for line in lines)
    assert f"  {LANE}: F 321 in training" in lines
    assert f"  {LANE}: F 300 ± 12 played" in lines
    assert lines[-1] == "Generation 0: best F 300, 1 of 2 trained"


def test_the_table_shows_verdict_and_fitness_of_each_slot_and_all_tokens():
    text = terminal_text()
    rows = {line.split()[0]: line for line in text.splitlines() if line[:1].isdigit()}
    assert PROGRAM.id in rows["0"] and "accepted" in rows["0"] and rows["0"].split()[-4:] == ["321", "300", "±", "12"]
    assert "refused: line 1:" in rows["1"]
    assert "1,334 tokens" in text  # 100 of an earlier process and 1234 of this one
    assert "epoch 1 of 4, 5,000 steps/s" in text


@pytest.mark.parametrize("width", [80, 160])
def test_the_table_fits_and_shows_how_f_went(width):
    console = Console(file=io.StringIO(), force_terminal=True, width=width, height=50)
    with view(CONFIG, Usage(), console) as shown:
        play(shown)
        for epoch in range(100):
            shown(TrainingProgress(epoch=epoch, epochs=100, env_steps_per_second=1.0, fitness={LANE: float(epoch)}))
        frame = Console(file=io.StringIO(), width=width)
        frame.print(shown.render())
    assert isinstance(frame.file, io.StringIO)
    row = next(line for line in frame.file.getvalue().splitlines() if line.startswith("0"))
    assert len(row.rstrip()) <= width and "▁" in row and "█" in row and "300 ± 12" in row


def test_the_log_of_a_long_training_is_short(monkeypatch):
    out, now = io.StringIO(), [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    with view(CONFIG, Usage(), Console(file=out, width=60)) as shown:
        for second in range(4 * 3600):
            now[0] = 1.0 + second
            shown(TrainingProgress(epoch=1 + second, epochs=14400, env_steps_per_second=1.0, fitness={}))
    assert 10 < len(out.getvalue().splitlines()) < 50


@pytest.mark.parametrize("shown", [plain_text, terminal_text])
def test_text_of_a_model_is_printed_as_text(shown):
    text = shown()
    assert "[bold]x[/bold]" in text
    assert "\x1b]0" not in text and "\x1b[2J" not in text and "\u202e" not in text


def test_the_time_left_is_judged_by_finished_generations(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(live.time, "monotonic", lambda: now[0])
    tally = Tally(RunConfig(iteration=3), Usage())
    tally.hear(Began("sample", 0))
    assert tally.remaining() is None
    now[0] = 60.0
    tally.hear(Generation(0, ()))
    tally.hear(Began("sample", 1))
    now[0] = 70.0
    assert tally.remaining() == 110.0  # two generations of 60 s, of which 10 s have passed


def test_a_resumed_run_does_not_time_what_the_store_had():
    tally = Tally(RunConfig(iteration=3), Usage())
    tally.hear(Generation(0, ()))
    assert tally.durations == []


def test_training_is_not_expected_to_be_shorter_because_the_model_takes_its_time(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(live.time, "monotonic", lambda: now[0])
    tally = Tally(RunConfig(iteration=2), Usage())
    for name, end in (("sample", 60.0), ("train", 160.0)):
        tally.hear(Began(name, 0))
        now[0] = end
    tally.hear(Generation(0, ()))
    tally.hear(Began("sample", 1))
    now[0] += 200.0
    assert tally.remaining() == 100.0  # asking is overdue, the 100 s of training are all ahead
    tally.hear(Began("train", 1))
    now[0] += 30.0
    assert tally.remaining() == 70.0
    tally.hear(Began("final"))
    assert tally.remaining() is None  # nothing tells how long the final trainings take


def test_a_tuning_after_a_search_is_told_as_such_and_not_as_a_new_search():
    wanted = RunConfig(env="cartpole", sample=8, iteration=3, tune=16)
    tally = Tally(wanted, Usage())
    tally.hear(Generation(0, ()))
    told = []
    rounds = (Began("check", round=0), Began("train", round=1))
    for began in (Began("train", 2), Began("final"), Began("evaluate"), *rounds, Began("final")):
        tally.hear(began)
        told.append(tally.stage)
    assert told == ["generation 2 (0 to 2)", "final", "final", "round 0 (0 to 3)", "round 1 (0 to 3)", "final"]
    assert tally.remaining() is None
    with view(wanted, Usage(), Console(file=io.StringIO(), force_terminal=True, width=160)) as shown:
        assert isinstance(shown, TerminalView)
        shown(Began("evaluate"))
        shown(RESULT)
        shown(Began("check", round=0))
        frame = Console(file=io.StringIO(), width=160)
        frame.print(shown.render())
        assert isinstance(frame.file, io.StringIO) and LANE not in frame.file.getvalue()


def test_final_trainings_are_called_by_the_slot_of_their_reward_and_its_seed():
    winner, twin = replace(ACCEPTED, generation=0, slot=3), replace(ACCEPTED, generation=1, slot=0)
    with view(CONFIG, Usage(), Console(file=io.StringIO(), force_terminal=True, width=160)) as shown:
        assert isinstance(shown, TerminalView)
        shown(Generation(0, (Scored(sample=winner, result=RESULT, feedback=""),)))  # as a resumed run tells it
        shown(Checked(twin))
        shown(Began("final"))
        for lane in (f"{PROGRAM.id}-s1", "human-s2", f"{PROGRAM.id}-s0-uniform"):
            shown(replace(RESULT, lane=lane))
        frame = Console(file=io.StringIO(), width=160)
        frame.print(shown.render())
    assert isinstance(frame.file, io.StringIO)
    _, head, *rows = frame.file.getvalue().splitlines()
    assert head.split("  ")[0] == "reward, seed" and head.split().count("training") == 1
    assert [row.split("  ")[0] for row in rows] == ["g0s3, 1", "human, 2", "g0s3, 0-uniform"]


def shown_rows(shown: TerminalView) -> dict[str, str]:
    frame = Console(file=io.StringIO(), width=160)
    frame.print(shown.render())
    assert isinstance(frame.file, io.StringIO)
    return {line.split()[0]: line for line in frame.file.getvalue().splitlines() if line[:1].isdigit()}


def test_a_slot_that_the_model_writes_for_says_so_and_for_how_long(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(live.time, "monotonic", lambda: now[0])
    with view(CONFIG, Usage(), Console(file=io.StringIO(), force_terminal=True, width=160)) as shown:
        assert isinstance(shown, TerminalView)
        shown(Began("sample", 0))
        shown(Asked((0, 1)))
        now[0] = 75.0
        assert "being written, 1 min 15 s" in shown_rows(shown)["1"]
        shown(Replied(0, Reply(text="x", model="m")))
        assert "replied" in shown_rows(shown)["0"]
        shown(Checked(ACCEPTED))
        shown(Checked(REFUSED))
        shown(Asked((0, 1)))
        rows = shown_rows(shown)
    assert "being written again: it repeated a reward, 0 s" in rows["0"] and "accepted" not in rows["0"]
    assert "being written again: it was refused" in rows["1"]


def test_a_log_names_the_slots_that_are_asked_for():
    out = io.StringIO()
    with view(CONFIG, Usage(), Console(file=out, width=60)) as shown:
        shown(Asked((1,)))
        shown(Asked((0, 1)))
    assert out.getvalue() == "  asked for 1 reward: slot 1\n  asked for 2 rewards: slot 0, 1\n"
