"""What a robot is to do, and so what F measures, guessed from the model's names and a person's sentence.

The guess becomes the task's F. If any word of the sentence is not understood, there is no F, and the draft says so.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import TaskError, nearest
from .survey import Point, Survey

NEAR = 0.2
"""A goal is reached within this share of the distance at the start; within `NEAREST` or the size of both, if more."""
NEAREST = 0.01
"""[m] within which a goal always counts as reached."""
POSES = 101
"""Random poses that are tried, to make up a goal within reach or to check that one can be reached."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Aim:
    """What F measures. One of `missing`, `goal`, `point` is set, or none for a robot that runs along x."""

    measure: str
    """F in words; empty where there is no F."""
    description: str
    """The sentence for the language model, if a person gives none."""
    missing: str = ""
    """Why there is no F."""
    mover: Point | None = None
    """What is brought to the goal."""
    hand: Point | None = None
    """What brings it, where that is something else."""
    goal: Point | None = None
    """Where it is brought to."""
    point: tuple[float, ...] = ()
    """[m] a made-up goal, where the model has none that would do."""
    reached: float = 0.0
    """[m] within which the goal counts as reached."""
    doubt: str = ""
    """What speaks against the guess."""
    there: bool = False
    """Whether the goal is reached at the start."""


def find_aim(survey: Survey, intent: str = "", *, names: Iterable[str] = (), thing: str = "", goal: str = "") -> Aim:
    """The aim that a person names, else the one that the intent describes, else the likeliest for the model.

    Args:
        names: further names of the robot.
        thing: the body, site or geom to bring to another one, `goal`; either may be empty for a guess.

    Raises:
        TaskError: when the model has no such thing or goal, the thing does not move, or the goal moves with it.
    """
    if thing or goal:
        return _named_aim(survey, thing, goal)
    return _Reader(survey, intent, names).aim() if intent.strip() else _likely_aim(survey)


def _named_aim(survey: Survey, thing: str, goal: str) -> Aim:
    mover = _by_name(survey, thing) if thing else _default_mover(survey)
    if not survey.moves(mover):
        raise TaskError(f"`{mover.name}` is fixed to the world or mocap; name something that moves with object=NAME.")
    if goal:
        mark = _by_name(survey, goal)
        if not survey.has_middle(mark):
            raise TaskError(f"`{mark.name}` is a plane or a height field; name a single place on it with goal=NAME.")
        if survey.are_one(mover, mark):
            raise TaskError(
                f"`{mark.name}` moves with `{mover.name}`, so F would be constant; name another place with goal=NAME."
            )
        return _bring(survey, mover, mark)
    marks = _marks(survey, mover)
    if not marks:
        raise TaskError("The model has no body, site or geom named goal or target; name the place with goal=NAME.")
    return _bring(survey, mover, _fitting(mover, marks))


def _by_name(survey: Survey, name: str) -> Point:
    places = {place.name: place for place in reversed(survey.places())}
    if name not in places:
        meant = nearest(name, places) or f" It has {', '.join(reversed(places))}."
        raise TaskError(f"The model has no body, site or geom `{name}`.{meant}")
    return places[name]


def _likely_aim(survey: Survey) -> Aim:
    """Without a sentence: an object to a goal, else the robot to a goal, else forward, else a point within reach."""
    objects = [thing for thing in survey.objects if "goal" not in _words(thing.name)]  # a goal may slide too
    there = ""
    for mover in (*objects, _default_mover(survey)):
        if marks := _marks(survey, mover):
            movers = objects or [mover]
            # Of several objects, the one that shares a name with a goal: ball and target_ball.
            mover = max(movers, key=lambda place: _shared(place, _fitting(place, marks)))
            aim = _bring(survey, mover, _fitting(mover, marks))
            if not aim.there:
                return aim
            there = aim.doubt.removesuffix(".")
            break
    aim = _run(survey) if survey.base is not None else _reach_a_point(survey, _tip(survey))
    # That the goal is reached comes first: a person can mend it.
    return replace(aim, missing=f"{there}; besides, {aim.missing}") if aim.missing and there else aim


def _run(survey: Survey) -> Aim:
    assert survey.root is not None
    called = survey.root.name
    doubt = ""
    if survey.rises and not survey.has_ground:
        doubt = "But the model has no floor, so the robot falls: name a model that has one, often a scene.xml."
    elif survey.rises and not survey.can_stand:
        doubt = "But no part of the robot collides with the floor, so it falls: give its links collision shapes."
    return Aim(
        measure=f"the mean speed of {called} along x [m/s]",
        description=f"to make {called} move forward, along x, as fast as possible",
        doubt=doubt,
    )


def _reach_a_point(survey: Survey, mover: Point) -> Aim:
    """Bring a part of the robot to a made-up point: where the random pose of median distance takes it."""
    if survey.is_held(mover):
        return _unsaid(f"an equality constraint couples the joints that carry {mover.name}, so its reach is unknown")
    start = survey.where(mover)
    reach = sorted(survey.reach(mover, POSES), key=lambda place: float(np.linalg.norm(place - start)))
    point = reach[POSES // 2].round(3)
    reached = max(NEAREST, round(NEAR * float(np.linalg.norm(point - start)), 3))
    if np.linalg.norm(point - start) < reached:
        return _unsaid(f"no driven hinge or slide moves {mover.name} to another place")
    where = f"({', '.join(f'{x:g}' for x in point)})"
    why = "No goal of the model is usable" if _marks(survey, mover) else "The model has no goal"
    return Aim(
        measure=f"the share of time that {mover.name} is within {reached:g} m of a point within its reach, {where}",
        description=f"to bring {mover.name} to the goal",
        mover=mover,
        point=tuple(point.tolist()),
        reached=reached,
        doubt=f"{why}, so the point is made up.",
    )


def _bring(survey: Survey, mover: Point, goal: Point) -> Aim:
    distance = float(np.linalg.norm(survey.where(mover) - survey.where(goal)))
    # Two colliding things stay as far apart as they are thick. So does an object from a mark on what it lies on.
    solid = bool(survey.radius(goal)) or not survey.is_robots(mover)
    thick = survey.radius(mover) + survey.radius(goal) if solid else 0.0
    reached = round(max(NEAREST, NEAR * distance, thick), 3)
    hand = None if survey.is_robots(mover) else survey.root or _tip(survey)
    there, doubt = distance < reached, ""
    if there:
        doubt = f"{mover.name} is at {goal.name} from the start: move one of them, in the model or in `reset`."
    elif tied := survey.mooring(hand or mover):
        doubt = (
            f"{tied[0]} is tied to the mocap body {tied[1]}, which actions do not move: delete that equality, or bind "
            "`mocap_pos` in `__init__` and move it in `apply_action`."
        )
    elif survey.is_robots(mover) and survey.base is None and not survey.is_held(mover):
        reach = survey.reach(mover, POSES)
        least = float(np.linalg.norm(reach - survey.where(goal), axis=1).min()) if not survey.moves(goal) else 0.0
        if least > 2.0 * reached:
            doubt = f"In {POSES} random poses {mover.name} came no closer than {least:.2g} m: is the goal within reach?"
    return Aim(
        measure=f"the share of time that {mover.name} is within {reached:g} m of {goal.name}",
        description=f"to bring {mover.name} to {goal.name}",
        mover=mover,
        hand=hand,
        goal=goal,
        reached=reached,
        doubt=doubt,
        there=there,
    )


def _default_mover(survey: Survey) -> Point:
    """The base of a robot that moves about, else the end of the longest limb."""
    return survey.root or _tip(survey)


def _tip(survey: Survey) -> Point:
    """The end of the longest limb. A name such as `gripper` decides among several ends, and for a site at that end."""
    ends = [link for link in survey.links if survey.depth(link.body) == survey.depth(survey.links[0].body)]
    link = next((link for link in ends if _TIPS & set(_words(link.name))), ends[0])
    sites = [place for place in survey.places() if place.field == "site_xpos" and place.body == link.body]
    return next((site for site in sites if _TIPS & set(_words(site.name))), link)


def _marks(survey: Survey, mover: Point) -> list[Point]:
    """The places called goal or target, except those that move with the mover."""
    places = [place for place in survey.places() if survey.has_middle(place) and not survey.are_one(place, mover)]
    return [place for place in places if "goal" in _words(place.name)]


def _fitting(mover: Point, marks: Sequence[Point]) -> Point:
    return max(marks, key=lambda mark: _shared(mover, mark))  # the first of equals: bodies before sites before geoms


def _shared(one: Point, other: Point) -> int:
    return len(set(_words(one.name)) & set(_words(other.name)))


class _Reader:
    """Reads a sentence like "to run forward" or "to push the red cube onto the goal". It must know every word.

    Args:
        names: names of the robot besides that of its base.
    """

    def __init__(self, survey: Survey, intent: str, names: Iterable[str]) -> None:
        self.survey, self.words = survey, _words(intent)
        self.said = {_stem(word): word for word in _split(intent)}
        robot = {word for name in names for word in _words(name)} | set(_words(survey.root.name if survey.root else ""))
        others = {word for place in survey.places() if place != survey.root for word in _words(place.name)}
        self.itself = _ITSELF | robot - others - _RUN - _MANNER - _BRING - _TOUCH
        """Words for the robot as a whole."""

    def aim(self) -> Aim:
        content = [word for word in self.words if word not in _FILLERS | self.itself]
        if (_RUN | {_stem("fast")}) & set(content) and set(content) <= _RUN | _MANNER and not _falls(content):
            if self.survey.base is None:
                return _unsaid("no joint without an actuator lets the robot move along x, so it counts as fixed")
            return _run(self.survey)
        if not content or content[0] not in _BRING | _TOUCH:
            return self._unknown(content)
        rest = self.words[self.words.index(content[0]) + 1 :]
        if content[0] in _TOUCH:
            goal, mover = _cut(rest, frozenset({"with"}))
        else:
            mover, goal = _cut(rest, _PLACED)
        goal = [word for word in goal if word not in _FILLERS | _WHERE]
        mover = [word for word in mover if word not in _FILLERS]
        if not goal or not (mover or content[0] in _GO | _TOUCH):
            return self._unknown(content)
        return self._bring(mover, goal)

    def _bring(self, mover_words: Sequence[str], goal_words: Sequence[str]) -> Aim:
        survey = self.survey
        movers = self._movers(mover_words)
        if len(movers) != 1:
            return self._unknown(mover_words, movers)
        mover = movers[0]
        goals = _mentioned(goal_words, [place for place in survey.places() if not survey.are_one(place, mover)])
        likeliest = max((_shared(mover, place) for place in goals), default=0)
        if len(goals) > 1 and likeliest:  # a ball and target_ball
            goals = [place for place in goals if _shared(mover, place) == likeliest]
            goals = goals[:1] if len({place.body for place in goals}) == 1 else goals
        if len(goals) == 1 and not survey.has_middle(goals[0]):
            return _unsaid(f"{goals[0].name} is a plane or a height field, not a single place for {mover.name}")
        if len(goals) == 1:
            return _bring(survey, mover, goals[0])
        if not goals and set(goal_words) == {"goal"} and survey.is_robots(mover) and survey.base is None:
            return _reach_a_point(survey, mover)
        return self._unknown(goal_words, goals)

    def _movers(self, words: Sequence[str]) -> list[Point]:
        survey = self.survey
        movers = [place for place in survey.places() if survey.moves(place)]
        found = _mentioned(words, [place for place in movers if "goal" in words or "goal" not in _words(place.name)])
        if found:
            return found
        if {_stem("object"), _stem("thing")} & set(words) and len(words) == 1:
            return survey.objects
        return [_default_mover(survey)] if set(words) <= self.itself else []

    def _unknown(self, words: Sequence[str], several: Sequence[Point] = ()) -> Aim:
        """An aim without F, which tells the words that were not understood, or what they may stand for."""
        if several:
            return _unsaid(f"the sentence may mean {' or '.join(dict.fromkeys(place.name for place in several))}")
        names = {word for place in self.survey.places() for word in _words(place.name)}
        known = names | _RUN | _MANNER | _BRING | _TOUCH | _PLACED
        strange = [word for word in dict.fromkeys(words) if word not in known]
        said = ", ".join(f'"{self.said[word]}"' for word in strange or dict.fromkeys(words))
        if words and not strange:
            return _unsaid(f"{said} alone does not say what to bring where")
        mean = "mean" if "," in said else "means"
        return _unsaid(f"it does not know what {said or 'that'} {mean} for this model")


def _falls(words: Sequence[str]) -> bool:
    """Whether the robot is to fall; in "without falling" it is not."""
    return any(word == "fall" and before != "without" for before, word in zip(["", *words], words, strict=False))


def _cut(words: Sequence[str], marks: frozenset[str]) -> tuple[list[str], list[str]]:
    """The words before and after the first of `marks`; all of them before, where there is none."""
    place = next((i for i, word in enumerate(words) if word in marks), len(words))
    return list(words[:place]), list(words[place + 1 :])


def _mentioned(words: Sequence[str], places: Sequence[Point]) -> list[Point]:
    """The place with all these words in its name, colours and sizes apart; several where they fit equally well."""
    wanted = set(words)
    nouns = wanted - _LOOKS
    fits: dict[tuple[int, int], list[Point]] = {}
    for place in places:
        has = set(_words(place.name))
        if nouns and nouns <= has:
            fits.setdefault((len(wanted & has), -len(has - wanted)), []).append(place)
    best = fits[max(fits)] if fits else []
    return best if len({place.body for place in best}) > 1 else best[:1]


def _unsaid(why: str) -> Aim:
    return Aim(measure="", description="", missing=why)


def _words(text: str) -> list[str]:
    """The words of a text in lower case, without endings; `target` becomes `goal`."""
    return [_stem(word) for word in _split(text)]


def _split(text: str) -> list[str]:
    """Words and numbers in lower case; `leftHand` is two words."""
    return re.findall(r"[^\W\d_]+|\d+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text).lower())


def _stem(word: str) -> str:
    if len(word) > 5 and word.endswith("ing"):
        word = word[:-3]
        word = word[:-1] if len(word) > 2 and word[-1] == word[-2] and word[-1] != "l" else word
    elif len(word) > 3 and word.endswith("s") and not word.endswith(("ss", "us", "is")):
        word = word[:-1]
    if len(word) > 3 and word.endswith("e"):
        word = word[:-1]
    return "goal" if word == "target" else word


def _vocabulary(words: str) -> frozenset[str]:
    return frozenset(_words(words))


_FILLERS = _vocabulary("to the a an it its so that is be can of for make let have as and robot")
_LOOKS = _vocabulary("red green blue yellow white black orange purple pink grey gray small big large little")
_RUN = _vocabulary("run walk hop gallop trot crawl swim sprint forward forwards ahead")
_MANNER = _vocabulary("fast quickly speed possible move go travel along x axis without fall at")
_GO = _vocabulary("go come get move fly drive swim walk run steer travel")
_BRING = _GO | _vocabulary("bring push pull slide roll carry place put drag deliver take catch hold keep guide")
_TOUCH = _vocabulary("reach touch")
_PLACED = _vocabulary("to onto into in on at toward towards near inside")
_WHERE = _vocabulary("position location spot point marker")
_ITSELF = _vocabulary("robot arm end effector itself")
_TIPS = _vocabulary("tip end ee eef tcp hand grip gripper grasp pinch tool finger fingertip effector")
