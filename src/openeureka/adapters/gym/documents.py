"""What an environment's documentation says of its observation and actions, without words on reward or success."""

from __future__ import annotations

import builtins
import inspect
import keyword
import re
from collections.abc import Collection, Iterable

from ...tasks.context import AIMLESS
from ...text import nameable
from ...types.tasks import StateUse

WHOLE = ("obs_buf", "previous_obs_buf", "actions")
"""Variables that every environment has."""
TAKEN = frozenset(
    (*WHOLE, "outcome", "num_envs", "device", *keyword.kwlist, "torch", "math", "np", "typing", "Dict", "Tuple")
)
"""Names that mean something else in a reward. `outcome` is what F gains in a step."""

_ENDS = ("episode end", "episode termination", "termination")
_TOLD = ("description", "action space", "observation space", "starting state", *_ENDS)
_TRUNCATION = re.compile(r"^[^\w\n]*(?:\d+[.)] *)?Truncation\b.*", re.IGNORECASE | re.MULTILINE | re.DOTALL)
"""The last part of a section on how episodes end. The episode length already tells it."""
_BETRAYS = re.compile(r"reward|score|success|fitness|recipe|return|solved|penal|rwd|bonus|\bsparse\b", re.IGNORECASE)
_COMPLETE = re.compile(r"(?:^|_)complet", re.IGNORECASE)
"""In a name, another word for success. In a text, often just an adverb."""
_GOAL = re.compile(r"\b(?:goal|aim|objective|task)\b[^.]*?\bis (to [^.]+?)(?:\.(?:\s|$)|$)", re.IGNORECASE)
_NUMBER = re.compile(r"\d+")
_FIGURE = re.compile(r"```\{figure\}.*?```|!\[[^\]]*\]\([^)]*\)", re.DOTALL)
_PADDING = re.compile(r"(?<=\|) {2,}| {2,}(?=\|)|(?<=---)-+ *")
"""Padding of the columns of a table."""
_TABLED = "(The state table has them.)"
_LEG = ("hip_angle", "hip_speed", "knee_angle", "knee_speed", "contact")
KNOWN = {
    "LunarLander": (
        "x", "y", "x_velocity", "y_velocity", "angle", "angular_velocity",
        "left_leg_contact", "right_leg_contact",
    ),
    "BipedalWalker": (
        "hull_angle", "hull_angular_velocity", "x_velocity", "y_velocity",
        *(f"leg_{leg}_{part}" for leg in (1, 2) for part in _LEG),
        *(f"lidar_{ray}" for ray in range(10)),
    ),
}  # fmt: skip
"""Names of the columns of environments whose documentation lists them in prose."""
GOALS = {
    "LunarLander": "to land gently on the landing pad",
    "BipedalWalker": "to walk to the far (right) end of the terrain without falling",
}
"""Goals of environments whose documentation states them only through the reward."""


def sections(text: str) -> dict[str, str]:
    """The documentation's sections by title in lower case. Text before the first title has its first line as title."""
    found: dict[str, str] = {}
    for part in re.split(r"^ {0,3}#+ *", inspect.cleandoc(text), flags=re.MULTILINE):
        title, _, body = part.partition("\n")
        found.setdefault(title.strip().lower(), body.strip())
    return found


def told(text: str, names: Collection[str] = ()) -> str:
    """What a language model may read of the documentation: paragraphs on the world, the actions, the observation, the
    start, and what ends an episode early.

    Args:
        names: names in the state table. A table that only repeats them is left out.
    """
    known = sections(_FIGURE.sub("", text))
    shown = []
    for title in _TOLD:
        text = known.get(title, "")
        parts = [part.strip() for part in (_TRUNCATION.sub("", text) if title in _ENDS else text).split("\n\n")]
        kept = [part for part in parts if part and not _BETRAYS.search(part)]
        if kept:
            said = [_TABLED if _repeats(part, names) else _PADDING.sub(" ", part) for part in kept]
            shown.append("\n\n".join([f"## {title.capitalize()}", *said]))
    return "\n\n".join(shown)


def _repeats(part: str, names: Collection[str]) -> bool:
    """Whether a part is a table of the observation that adds nothing to these names: all are known, no value has a
    finite bound."""
    rows = _listed(_tables(part)[0]) if part.startswith("|") else []
    bounds = [value for row in rows for title, value in row.items() if title in ("min", "max")]
    called = identifiers(row["observation"] for row in rows)
    return bool(rows) and set(called) <= set(names) and all("inf" in bound.lower() for bound in bounds)


def intent(text: str, env: str) -> str:
    """The goal as the documentation words it, such as `to balance the pole`, cut off before it mentions reward or
    success; else one of `GOALS`, else to do what the environment is made for."""
    words = " ".join(sections(text).get("description", "").split())
    found = _GOAL.search(words)
    said = found[1] if found else ""
    if betrayal := _BETRAYS.search(said):
        said = said[: max(0, *(said.rfind(end, 0, betrayal.start()) for end in ",;"))]
    return said.replace("`", "") or GOALS.get(bare(env)) or f"to do in {env} {AIMLESS}"


def bare(env: str) -> str:
    """An id without its package, its namespace and its version."""
    return env.rpartition(":")[2].rpartition("/")[2].rpartition("-v")[0]


def columns(text: str, name: str, count: int) -> list[tuple[str, str]]:
    """Name and meaning of each column of the observation, if the documentation has a table of all of them; else of the
    first columns, if it has a table of those."""
    if len(known := KNOWN.get(name, ())) == count:
        return [(column, column.replace("_", " ")) for column in known]
    first: list[tuple[str, str]] = []
    for table in _tables(text):
        rows = _listed(table)
        if len(rows) > count:
            continue
        units = [next((value for title, value in row.items() if "unit" in title), "") for row in rows]
        meanings = [_meaning(row["observation"], unit) for row, unit in zip(rows, units, strict=True)]
        found = list(zip(identifiers(row["observation"] for row in rows), meanings, strict=True))
        if len(rows) == count:
            return found
        first = max(first, found, key=len)
    return first


def _listed(table: list[list[str]]) -> list[dict[str, str]]:
    """The rows of a table, as cells by title in lower case, if it lists the columns of an observation in order."""
    titles = [title.lower() for title in table[0]]
    rows = [row for row in table[1:] if _NUMBER.fullmatch(row[0])]
    in_order = [int(row[0]) for row in rows] == list(range(len(rows)))
    if "observation" not in titles or not titles[0].startswith(("num", "index")) or not in_order:
        return []
    return [dict(zip(titles, row, strict=False)) for row in rows]


def _tables(text: str) -> list[list[list[str]]]:
    """Every table of a text in Markdown, as rows of cells."""
    found: list[list[list[str]]] = []
    before = False
    for line in text.splitlines():
        row = line.strip()
        if row.startswith("|"):
            found = found if before else [*found, []]
            found[-1].append([cell.strip() for cell in row.strip("|").split("|")])
        before = row.startswith("|")
    return found


def _meaning(text: str, unit: str) -> str:
    unit = re.sub(r"^.*\(([^()]*)\)$", r"\1", unit)
    said = " ".join(text.replace("`", "").split())
    return f"{said} [{unit}]" if unit else said


def identifiers(texts: Iterable[str]) -> list[str]:
    """Each text as a unique name that a reward may use: `Pole Angle` is `pole_angle`."""
    found: list[str] = []
    for text in texts:
        bare = re.sub(r"\s\([^()]*\)", "", text)
        words = re.sub(r"\b(?:the|a)\b", " ", nameable(bare.lower())).split()
        name = "_".join(words) or "value"
        taken = name in TAKEN or hasattr(builtins, name)
        name = f"value_{name}" if taken or not name[0].isalpha() else name
        number, base = 1, name
        while name in found:
            number += 1
            name = f"{base}_{number}"
        found.append(name)
    return found


def betrays(name: str) -> bool:
    """Whether a name hints at reward or success."""
    return bool(_BETRAYS.search(name) or _COMPLETE.search(name))


def use_of(words: str) -> StateUse:
    """How the typed grammar may use a number. Angles, actions and differences are best near zero; of anything else,
    including heights and cosines, more or less may be better."""
    plain = words.lower().replace("_", " ")
    directed = re.search(r"velocity|velocities|speed|\b(?:cos|sin)(?:ine|e)?\b", plain)
    gap = re.search(r"\b(?:angle|rotation|action|error)|\bto (?!be\b)|\bdifference| - ", plain)
    return "zero_centred" if gap and not directed else "directional"
