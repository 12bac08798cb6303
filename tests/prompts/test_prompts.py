"""Golden texts: what is sent, word for word. `EUREKA_GOLDEN=write` renews them; the difference is read in review."""

import os
from pathlib import Path

import pytest

from openeureka import prompts
from openeureka.types import (
    Candidate,
    Finding,
    Message,
    Prompt,
    PromptPlan,
    Sample,
    Scored,
    StateSpec,
    StateVar,
    TaskContext,
    Verdict,
    VerdictCode,
)

GOLDEN = Path(__file__).parents[1] / "golden"
CONTEXT = TaskContext(
    env="cartpole",
    description="to balance a pole on a cart so that the pole stays upright",
    state=StateSpec(
        (
            StateVar(name="dof_pos", shape=(2,), meaning="cart position [m], pole angle [rad]"),
            StateVar(name="pole_angle", meaning="pole angle from upright [rad]", use="zero_centred"),
            StateVar(name="tip_position", shape=(3,), meaning="tip of the pole [m]", use="point"),
            StateVar(name="top_position", shape=(3,), meaning="where the tip belongs [m]", use="point"),
            StateVar(name="tip_height", meaning="height of the tip [m]", use="directional"),
            StateVar(name="limits", shape=(2,), kind="constant", meaning="joint limits [rad]"),
            StateVar(name="dt", kind="float", meaning="time between two actions [s]"),
        )
    ),
    source="class Cartpole:\n\n    def observe(self, s):\n        return s['dof_pos']\n",
)
REFUSED = Verdict(
    candidate="x", code=VerdictCode.REFUSED, findings=(Finding(rule="unknown-input", message="no `foo`", line=3),)
)


def entry(source: str, feedback: str, verdict: Verdict = REFUSED) -> Scored:
    candidate = Candidate.of(source)
    return Scored(
        sample=Sample(generation=0, slot=0, candidate=candidate, verdict=verdict), result=None, feedback=feedback
    )


FIRST = entry("def compute_reward(pole_angle):\n    return -pole_angle.abs(), {}\n", "task_score: [1.00, 2.00]")
SECOND = entry("def compute_reward(dof_pos):\n    return dof_pos[:, 1], {}\n", "task_score: [3.00, 4.00]")


def text(prompt: Prompt) -> str:
    parts = [f"=== {message.role} ===\n{message.content}\n" for message in prompt.messages]
    if prompt.grammar is not None:
        parts += [f"=== prefill ===\n{prompt.prefill}\n", f"=== grammar ===\n{prompt.grammar}"]
    return "\n".join(parts)


@pytest.mark.parametrize("style", ["free", "grammar"])
@pytest.mark.parametrize("turns", [(), (FIRST, SECOND)], ids=["first", "later"])
def test_the_prompt_is_the_golden_one(style, turns):
    path = GOLDEN / f"prompt_{style}_{'later' if turns else 'first'}.md"
    rendered = text(prompts.render(CONTEXT, PromptPlan(count=4, turns=turns), style))
    if os.environ.get("EUREKA_GOLDEN") == "write":
        path.write_text(rendered, encoding="utf-8")
    assert rendered == path.read_text(encoding="utf-8")


def test_free_turns_alternate_and_grammar_keeps_the_newest():
    plan = PromptPlan(count=1, turns=(FIRST, SECOND))
    free, grammar = prompts.render(CONTEXT, plan, "free"), prompts.render(CONTEXT, plan, "grammar")
    assert [message.role for message in free.messages] == ["system", "user", "assistant", "user", "assistant", "user"]
    assert [message.role for message in grammar.messages] == ["system", "user", "assistant", "user"]
    assert "dof_pos[:, 1]" in grammar.messages[2].content


@pytest.mark.parametrize("style", ["free", "grammar"])
def test_when_nothing_trained_the_model_is_told_each_reason_once(style):
    plan = PromptPlan(count=1, failures=(FIRST, FIRST, SECOND))
    last = prompts.render(CONTEXT, plan, style).messages[-1]
    assert last.role == "user" and last.content.count("line 3: no `foo` [unknown-input]") == 1
    assert "None of the programs" in last.content


def test_a_repair_shows_the_reply_and_its_findings():
    prompt = Prompt(messages=(Message("user", "write"),), grammar="g", prefill="p")
    repair = prompts.repair(prompt, "my\x00 reply", REFUSED)
    assert [message.role for message in repair.messages] == ["user", "assistant", "user"]
    assert repair.messages[1].content == "my reply"
    assert "- line 3: no `foo` [unknown-input]" in repair.messages[2].content
    assert (repair.grammar, repair.prefill) == ("g", "p")


def test_control_invisible_and_direction_changing_characters_vanish():
    hostile = "a\x1b[31mb\u202ec\u200bd\x00e\ud800f\r\ng\th"
    assert prompts.clean(hostile, 100) == "a[31mbcdef\ng\th"


def test_a_long_text_loses_its_middle():
    cut = prompts.clean("a" * 600 + "b" * 600, 100)
    assert cut == "a" * 50 + "\n[...]\n" + "b" * 50


def test_braces_of_a_program_are_not_taken_for_fields_of_a_template():
    braces = entry("def compute_reward(x):\n    return x, {'{x}': x}\n", "{feedback} {0}")
    for style in ("free", "grammar"):
        prompt = prompts.render(CONTEXT, PromptPlan(count=1, turns=(braces,)), style)
        assert "{'{x}': x}" in prompt.messages[2].content and "{feedback} {0}" in prompt.messages[3].content


def test_feedback_and_programs_are_capped():
    huge = entry("def f():\n" + "    pass\n" * 100_000, "y" * 100_000)
    free = prompts.render(CONTEXT, PromptPlan(count=1, turns=(huge,)), "free")
    assert sum(len(message.content) for message in free.messages[2:]) < prompts.MAX_PROGRAM + prompts.MAX_FEEDBACK + 500
