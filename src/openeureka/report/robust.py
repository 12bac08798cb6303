"""What `eureka robust` made of the best policy: tables, and a verdict."""

from __future__ import annotations

from ..numbers import number, scored
from ..refine.hardened import LONGER, PLAIN, UNIFORM, Robust
from ..score import gain, pooled
from .tables import Table
from .verdict import decided


def verdict(found: Robust) -> str:
    """Whether the proposed ranges made a policy that is better in hard worlds, and what that costs in its own world. A
    policy that went on from the best one may be better for its longer training alone, so it is compared with a policy
    that trained as long."""
    by_name = {arm.name: arm for arm in found.arms}
    ours, plain = by_name.get(found.ours), by_name[PLAIN]
    longer, uniform = by_name.get(LONGER), by_name.get(UNIFORM)
    if ours is None or ours.hard is None or plain.hard is None:
        return "Not decided yet: `eureka robust DIR` continues it."
    control, others = plain, [f"{number(plain.hard)} before"]
    if longer is not None and longer.hard is not None:
        control = longer
        own = longer.ranges is not None and longer.ranges.drawn
        where = "with the run's own ranges" if own else "without ranges"
        others.insert(0, f"{number(longer.hard)} after as much training {where}")
    if uniform is not None and uniform.hard is not None:
        others.insert(-1, f"{number(uniform.hard)} with uniform ranges")
    more = gain(*(pooled([*arm.worlds.values()], shared=True) for arm in (ours, control)))
    between = f"F {number(ours.hard)} against {', '.join(others)}"
    nominal = f"In the task's own world: {scored(ours.nominal)} against {scored(plain.nominal)} before."
    broken = f" But it breaks a limit of the run: {ours.breach}." if ours.breach else ""
    if more is None or more.low is None:
        return f"Not decided in hard worlds: {between}. {nominal}{broken}"
    told = decided(more, "In hard worlds the new policy is {}", between, unless="Not decided in hard worlds")
    return f"{told} {nominal} One training each.{broken}"


def arms(found: Robust) -> Table:
    """A row for each policy."""
    rows = [
        (
            f"{arm.name}, chosen" if arm.name == found.ours else arm.name,
            str(arm.ranges) if arm.ranges is not None and arm.ranges.drawn else "none",
            number(arm.chosen_by),
            number(arm.hard),
            scored(arm.nominal),
        )
        for arm in found.arms
    ]
    note = (
        "F is a mean over hard worlds, which no model was shown. Proposals are chosen on separate start states; "
        "held-out scores use start states that nothing was chosen by."
    )
    titles = (
        "policy",
        "ranges of its training worlds",
        "F in hard worlds, for choosing",
        "F in hard worlds, held out",
        "F in the task's own world",
    )
    return Table(titles, rows, note)


def worlds(found: Robust) -> Table:
    """Held-out F in each hard world, of the policies that were judged."""
    judged = [arm for arm in found.arms if arm.worlds]
    names = dict.fromkeys(name for arm in judged for name in arm.worlds)
    rows = [(name, *(scored(arm.worlds.get(name)) for arm in judged)) for name in names]
    return Table(("hard world", *(arm.name for arm in judged)), rows)


def carried(found: Robust) -> Table:
    """The range of each quantity in which a policy works, before and after, one quantity changed at a time."""
    after = {one.name: one for one in found.after}
    rows = [
        (one.name, _span(one.low, one.high), _span(after[one.name].low, after[one.name].high) if after else "-")
        for one in found.before
    ]
    return Table(("keeps 75 % of what was learnt", "before", "after"), rows)


def _span(low: float | None, high: float | None) -> str:
    return f"{low:g} to {high:g}" if low is not None and high is not None else "-"
