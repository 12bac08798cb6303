"""Fills the slots of a generation with accepted programs, as far as the allowed attempts go."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Protocol

from ..config import RunConfig
from ..errors import ModelError, RewardFileError
from ..events import Asked, Began, Checked, Replied, Tell, nobody
from ..llm import price
from ..llm.client import LanguageModel
from ..llm.random import RandomModel
from ..reward import extract
from ..store import Store
from ..types import (
    GIVEN,
    Candidate,
    Finding,
    Message,
    Prompt,
    PromptPlan,
    Reply,
    Sample,
    TaskContext,
    Verdict,
    VerdictCode,
)
from . import prompts


class Checker(Protocol):
    """Judges programs, like `sandbox.client`."""

    def check(self, candidate: Candidate) -> Verdict:
        """Judge a program. A fault of the program never raises; SandboxUnavailable means that nothing can be judged."""
        ...


NO_PROGRAM = Verdict(
    candidate="",
    code=VerdictCode.NO_PROGRAM,
    findings=(
        Finding(
            rule="no-program",
            message="the reply holds no Python function",
            fix="answer with one function `compute_reward` in a python code block",
        ),
    ),
)


@dataclass(frozen=True, slots=True)
class Sampler:
    """Draws replies until each slot holds an accepted program or its attempts are spent.

    Attempt 0 is a fresh sample. A refused program gets up to `repair` repair turns, then the slot is sampled anew, up
    to `refill` times. A slot whose program repeats one of this run is sampled anew too, and keeps that program if
    nothing else comes.

    A reply is committed before anything else happens to it, so only one that is under way can be lost.
    """

    config: RunConfig
    store: Store
    model: LanguageModel
    checker: Checker
    context: TaskContext
    tell: Tell

    def fill(self, generation: int, plans: Sequence[PromptPlan]) -> tuple[Sample, ...]:
        """One sample per slot; the slots of all plans are numbered consecutively."""
        earlier = [entry.sample for entry in self.store.history().entries]
        samples: list[Sample] = []
        for plan in plans:
            slots = range(len(samples), len(samples) + plan.count)
            prompt = prompts.render(self.context, plan, self.model.style, progress=self.config.bonus == "progress")
            parent = plan.turns[-1].sample.place if plan.turns else None
            self.store.talk.save_prompt(generation, slots, prompt, parent)
            samples += self._fill(generation, prompt, slots, known=[*earlier, *samples])
        return tuple(samples)

    def initial(self) -> tuple[Sample, ...]:
        """Generation 0 of a run that begins with a given reward: only this reward, kept as if it were a reply.

        Raises:
            RewardFileError: when it cannot be read or was refused; no reply is stored then.
        """
        if self.store.talk.reply(0, 0, 0) is None:
            reply = Reply(text=extract.fenced(init_candidate(self.config).source), model=GIVEN)
            _accept(self.config, self._judged(reply)[1])
            self.store.talk.save_reply(0, 0, 0, reply)
        self.store.talk.save_slots(0, range(1), asked=None, parent=None)
        return (self._check(0, 0, 0),)

    def _fill(self, generation: int, prompt: Prompt, slots: Sequence[int], known: Sequence[Sample]) -> list[Sample]:
        filled: dict[int, Sample] = {}
        shown: dict[int, tuple[Message, ...]] = {}
        turns = 1 + self.config.repair
        for attempt in range(turns * (1 + self.config.refill)):
            vacant = [slot for slot in slots if slot not in filled or not filled[slot].verdict.accepted]
            if attempt % turns == 0:
                vacant = sorted({*vacant, *_repeating(filled, known)})
                shown.clear()
                self._draw(prompt, generation, attempt, vacant)
            else:
                for slot in vacant:
                    reply = self._reply(generation, attempt - 1, slot)
                    repair = prompts.repair(prompt, reply.text, filled[slot].verdict)
                    shown[slot] = repair.messages[len(prompt.messages) :]
                    self._draw(repair, generation, attempt, [slot])
            if vacant:
                self.tell(Began("check", generation))
            for slot in vacant:
                sample = self._check(generation, attempt, slot, shown.get(slot, ()))
                if slot not in filled or sample.verdict.accepted or not filled[slot].verdict.accepted:
                    filled[slot] = sample
                else:  # a repeated program is better than none
                    filled[slot] = replace(filled[slot], attempts=sample.attempts)
        return [filled[slot] for slot in slots]

    def _draw(self, prompt: Prompt, generation: int, attempt: int, slots: Sequence[int]) -> None:
        """Ask for the replies that the store does not hold yet."""
        missing = [slot for slot in slots if self.store.talk.reply(generation, attempt, slot) is None]
        if not missing:
            return
        self.tell(Began("sample", generation))
        seed = request_seed(self.config.seed, generation, attempt, slots[0])
        paid = self.store.talk.paid()
        for slot, reply in draw(self.model, prompt, slots, missing, seed, paid, self.config, self.tell):
            self.store.talk.save_reply(generation, attempt, slot, reply)
            self.tell(Replied(slot, reply))

    def _check(self, generation: int, attempt: int, slot: int, repair: Sequence[Message] = ()) -> Sample:
        candidate, verdict = self._judged(self._reply(generation, attempt, slot))
        found = candidate.id if candidate is not None else None
        self.store.rewards.save_attempt(generation, attempt, slot, found, repair)
        sample = Sample(generation=generation, slot=slot, candidate=candidate, verdict=verdict, attempts=attempt + 1)
        self.tell(Checked(sample))
        return sample

    def _judged(self, reply: Reply) -> tuple[Candidate | None, Verdict]:
        """The program of a reply, and the verdict on it; equal programs are judged once."""
        source = extract.program(reply.text)
        if source is None:
            return None, NO_PROGRAM
        candidate = Candidate.of(source)
        if self.store.rewards.verdict(candidate.id) is None:
            self.store.rewards.save_verdict(candidate, self.checker.check(candidate), reply)
        verdict = self.store.rewards.verdict(candidate.id)
        assert verdict is not None
        return candidate, verdict

    def _reply(self, generation: int, attempt: int, slot: int) -> Reply:
        """The reply as stored, not as received, so that a resumed run reads the same."""
        reply = self.store.talk.reply(generation, attempt, slot)
        assert reply is not None
        return reply


def init_candidate(config: RunConfig) -> Candidate:
    """The program that `init=` names: the human reward, or the one in a file, which may hold a model's whole answer.

    Raises:
        RewardFileError: when the file cannot be read.
        TaskError: when the task's human reward is a method, not a program.
    """
    if config.init == "human":
        from ..tasks import human  # the loop itself needs neither torch nor a simulator
        from ..tasks.registry import get

        return Candidate.of(human.program(get(config.env)))
    return extract.in_file(Path(config.init))[0]


def admit(config: RunConfig, checker: Checker) -> None:
    """Raise what `Sampler.initial` would raise, before anything of a run is made."""
    if config.init:
        _accept(config, checker.check(init_candidate(config)))


def _accept(config: RunConfig, verdict: Verdict) -> None:
    if not verdict.accepted:
        reasons = "; ".join(finding.sentence() for finding in verdict.findings)
        raise RewardFileError(f"init={config.init} was refused: {reasons}")


def _repeating(filled: Mapping[int, Sample], known: Iterable[Sample]) -> list[int]:
    """Slots whose accepted program computes the same as a known one or as that of an earlier slot."""
    seen = {str(sample.verdict.graph) for sample in known}
    repeating: list[int] = []
    for slot, sample in sorted(filled.items()):
        program = str(sample.verdict.graph)
        if sample.verdict.accepted and program in seen:
            repeating.append(slot)
        seen.add(program)
    return repeating


def draw(
    model: LanguageModel,
    prompt: Prompt,
    slots: Sequence[int],
    missing: Sequence[int],
    seed: int,
    paid: Sequence[Reply],
    config: RunConfig,
    tell: Tell = nobody,
) -> Iterator[tuple[int, Reply]]:
    """The missing replies of a request, each with its slot, as they come: as near as can be to those that the request
    would have given without an interruption.

    Args:
        slots: all slots of the request.
        seed: seed of the whole request.
        paid: every reply that the run has.
        tell: told that the model begins to write.

    Raises:
        BudgetError: when the replies would exceed `max_cost=`; nothing is asked then.
        ModelError: when the model gives fewer, or failed; more are not taken.
    """
    if config.max_cost:
        price.afford(config.max_cost, paid, price.find(config.model, config.price), prompt, len(missing))
    tell(Asked(tuple(missing)))
    held, left = slots.index(missing[0]), list(missing)
    if isinstance(model, RandomModel):  # each draw depends on the draws before it, and drawing again costs nothing
        replies = islice(model.sample(prompt, n=held + len(left), seed=seed), held, None)
    else:
        replies = model.sample(prompt, n=len(left), seed=(seed + held) % 2**31)
    for reply in replies:  # to the end of the generator, so that the model also does what follows its last reply
        if not left:
            break
        yield left.pop(0), reply
    if left:
        came = f"{len(missing) - len(left)} of {len(missing)}"
        raise ModelError(f"{model.name} gave {came} replies: its `sample` must yield n replies.")


def request_seed(seed: int, generation: int, attempt: int, slot: int) -> int:
    """A 31-bit seed for each request; consecutive slots have consecutive seeds, other requests have distant ones."""
    digest = hashlib.blake2b(f"{seed}/{generation}/{attempt}".encode(), digest_size=4).digest()
    return (int.from_bytes(digest) + slot) % 2**31
