"""What came of a run, in one sentence that opens every report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..method.prompts import scale
from ..numbers import number, scored
from ..refine.polishing import Polished
from ..refine.tuned import ORIGINAL, Tuned
from ..score import SeedScores, breach, learnt, rank
from ..stats import Difference, Estimate, difference, mean
from ..tasks import registry
from ..types import of_components
from .view import RunView

FEWEST = 3
"""Fewest seeds that a further training is proposed with."""


def verdict(run: RunView) -> str:
    """Which reward is better: after a search the generated or the human one, of given rewards the best or the second,
    after a tuning the one before or after."""
    scores = [*run.played.values(), *run.evaluations.values()]
    if scores and all(score.lost and not score.episodes for score in scores):
        return (
            "No policy has a score: every episode that was played ended because a reward, an observation or the "
            "physics was not finite."
        )
    if run.searched:
        return _of_search(run)
    return of_tuning(run.tuned) if run.tunes else _of_given(run)


def of_tuning(found: Tuned | None) -> str:
    """Whether the fitted numbers are better than the original ones."""
    if found is None or not found.done:
        return "Not decided yet: the final trainings are not done."
    if found.alone:
        return f"The numbers stay unchanged: no other weighting left a policy that could be scored.{_lost(found)}"
    before, after = found.finals[ORIGINAL], found.finals[found.after]
    if not before.scores or not after.scores:
        which = "original" if not before.scores else "tuned"
        return f"Not decided: with the {which} numbers, no final training left a policy that could be scored."
    if found.breach:
        return f"The numbers stay unchanged: policies of the tuned ones break a limit, {found.breach}."
    between = f"F {_mean_of(after)} against {_mean_of(before)}, held out"
    if found.breach_before:
        return f"The tuned numbers win: policies of the original ones break a limit, {found.breach_before}; {between}."
    difference = found.difference
    if difference is None:
        return f"Not decided: {between}. {_one_seed(before, after)}"
    told = decided(difference, "The tuned numbers are {} than the original ones", between)
    return told if difference.sure else f"{told} {_needed(difference)}"


def _lost(found: Tuned) -> str:
    """How many weightings were refused or failed, and the reason for the first."""
    name, reason = next(iter(found.lost.items()), ("", ""))
    others = len(found.trials) - 1
    told = f" {len(found.lost)} of {others} were refused or failed; the first, {name}: {reason.rstrip('.')}."
    return told if name else ""


def of_polishing(found: Polished) -> str:
    """Whether carrying the best policy on made a better one."""
    if found.best is None:
        return "Not decided yet: the policies that trained further are not judged."
    if found.chosen is None or found.after is None or found.after.fitness is None:
        return "Further training left no policy that could be scored: the one in best/ stays the best."
    if found.breach and not found.better:
        return f"The policy in best/ stays the best: the one that trained further breaks a limit, {found.breach}."
    between = f"F {scored(found.after)} against {scored(found.before)} of the policy it started from, held out"
    if found.better and found.breach_before and not found.breach:
        return f"The policy that trained further wins: the one before breaks a limit, {found.breach_before}; {between}."
    gain, both = found.gain, f" Both break a limit: {found.breach}." if found.breach else ""
    if gain is None or gain.low is None:
        return f"Not decided: {between}.{both}"
    return decided(gain, "The policy that trained further is {}", between) + both


def _of_given(run: RunView) -> str:
    """The given reward of highest held-out F, compared with the second."""
    rewards = run.given
    if not any(own.held_out for own in rewards.values()):
        return "No reward has been trained yet."
    best, *others = ordered(rewards)
    if not rewards[best].scores:
        return "Not decided yet: nothing has been scored on held-out episodes."
    if not others or not rewards[others[0]].scores:
        return f"{best}: F {_mean_of(rewards[best])}, held out."
    second = others[0]
    between = f"F {_mean_of(rewards[best])} against {_mean_of(rewards[second])}, held out"
    undecided = f"Not decided between {best} and {second}"
    found = lead(rewards, best, second)
    if found is None:
        return f"{undecided}: {between}. One seed says nothing about the next."
    if not found.sure and nothing_learnt(run):
        return _no_better("no", rewards[best], rewards[second], run.untrained)
    told = decided(found, f"{best} is {{}} than {second}", between, undecided)
    return told if found.sure else f"{told} {_needed(found)}"


def ordered(rewards: Mapping[str, SeedScores]) -> list[str]:
    """The names of given rewards, highest held-out F first."""
    return sorted(rewards, key=lambda name: -rank(mean(rewards[name].scores)))


def lead(rewards: Mapping[str, SeedScores], best: str, second: str) -> Difference | None:
    """How much higher held-out F of the best given reward is, which was picked among all."""
    rivals = [own.scores for name, own in rewards.items() if name not in (best, second)]
    return difference(rewards[best].scores, rewards[second].scores, rivals, claims=len(rewards) - 1)


def _of_search(run: RunView) -> str:
    """The verdict of a search, from held-out scores of its final trainings."""
    outcome = run.outcome
    if reason := limits_reason(run):
        return reason
    if run.best is None:
        return none_found(run) or "No reward has been trained yet."
    if outcome is None:
        return "Not decided yet: the final trainings are not done."
    generated, human = outcome.method, outcome.human
    if not generated.scores:
        return "The generated reward lost: none of its final trainings left a policy that could be scored."
    if not human.scores:
        lost = "no final training of the human reward left a policy that could be scored"
        without = lost if human.held_out else "there is no human reward to compare with"
        return f"The generated reward reaches F {_mean_of(generated)}, held out; {without}."
    if outcome.word == "nothing learnt":
        return _no_better("neither", generated, human, outcome.untrained)
    if outcome.same:
        return f"No difference: both rewards reach F {number(human.scores[0])} with every seed, held out."
    between = f"F {_mean_of(generated)} against {_mean_of(human)}, held out"
    found = outcome.difference
    if found is None and run.known_baselines is not None and len(human.scores) < 2:
        return f"Not decided: {between}. The human one was measured with one seed; baselines=train uses as many."
    if found is None:
        return f"Not decided: {between}. {_one_seed(generated, human)}"
    told = decided(found, "The generated reward is {} than the human one", between)
    return told if found.sure else f"{told} {_needed(found)}"


def limits_reason(run: RunView) -> str:
    """Why no reward won, where limits are the reason; empty where one did or the search is not done."""
    limits = run.config.cost_limits
    if not limits or run.crown is not None or not run.ended:
        return ""
    nearest = run.ranking.nearest
    if nearest is not None:
        broke = breach(nearest.played, limits)
        return f"No reward won: every policy breaks a limit. The closest is {nearest.sample.place}: {broke}."
    if run.ranking.best is not None:
        return "No reward won: trained again with fresh seeds, each of the best breaks a limit."
    return ""


def none_found(run: RunView) -> str:
    """Why a search that is over found no reward, with a finding on one of the newest replies. Empty where it found one,
    is not over, or limits are the reason."""
    done = run.history.generations
    if not run.searched or run.best is not None or len(done) < run.config.generations or limits_reason(run):
        return ""
    if any(entry.score is not None for entry in run.ranking.vetoed):
        return "No reward was found: a person vetoed every one that has a score."
    entries = [entry for generation in reversed(done) for entry in generation.entries]
    findings = ((entry.sample.place, finding) for entry in entries for finding in entry.sample.verdict.findings)
    told = next((f" The latest is {place}: {finding.sentence()}." for place, finding in findings), "")
    return f"No reward was found: none of {len(entries)} slots left a policy with a score.{told}"


def meaning(run: RunView) -> str:
    """What F measures, where the task is installed: a report does not import other people's files."""
    task = registry.offered(run.config.env)
    found = scale(task.score_unit, task.score_range) if task is not None else ""
    return f"F: {found}; higher is better." if found else "F is the task's own score; higher is better."


def components(run: RunView) -> str:
    """The components of the best reward; empty before anything trained."""
    result = run.best.result if run.best is not None else None
    names = of_components(result.curves) if result is not None else ()
    return f"Its components: {', '.join(names)}." if names else ""


def nothing_learnt(run: RunView) -> bool:
    """Whether policies of no reward are shown to be better than untrained ones. A tuning does not ask."""
    if run.searched:
        return run.outcome is not None and run.outcome.word == "nothing learnt"
    return not run.tunes and not learnt((own.scores for own in run.given.values()), run.untrained)


def _no_better(which: str, one: SeedScores, other: SeedScores, untrained: Sequence[float]) -> str:
    without = f"{number(mean(untrained) or 0.0)} untrained ({len(untrained)} seeds)"
    return (
        f"Nothing learnt: policies of {which} reward are shown to beat untrained ones; F {_mean_of(one)} against "
        f"{_mean_of(other)}, {without}, held out."
    )


def _mean_of(own: SeedScores) -> str:
    """Mean over seeds, and how many there are. The interval of the difference says how uncertain they are."""
    count, lost = len(own.scores), len(own.held_out) - len(own.scores)
    without = f", {lost} more without a score" if lost else ""
    return f"{number(mean(own.scores) or 0.0)} ({count} seed{'s' if count > 1 else ''}{without})"


def _one_seed(*rewards: SeedScores) -> str:
    """What to do where a reward has the score of one seed alone."""
    lost = any(len(own.held_out) > len(own.scores) for own in rewards)
    return "One seed says nothing about the next" + ("." if lost else "; seeds=3 would say more.")


def decided(found: Difference | Estimate, claim: str, between: str, unless: str = "Not decided") -> str:
    """A difference as one sentence.

    Args:
        claim: opening of the sentence where the difference is sure; `{}` stands for better or worse.
        between: the two numbers.
        unless: opening of the sentence where it is not.
    """
    opening = claim.replace("{}", "better" if found.value > 0 else "worse") if found.sure else unless
    interval = f"difference {found.value:+.3g}, 95 % interval {found.low:+.3g} to {found.high:+.3g}"
    return f"{opening}: {between}; {interval}."


def _needed(found: Difference) -> str:
    if found.seeds is None:
        return "So small a difference would take more than 100 seeds of each to decide."
    return f"If the difference is real, {enough(found.seeds)} new seeds of each have an even chance to show it."


def enough(seeds: int) -> int:
    """How many new seeds to train two rewards with."""
    return max(FEWEST, seeds)
