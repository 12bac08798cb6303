import json

import pytest

from openeureka.ui.follow import PAUSE, Fresh, Version, events

from .serving import awaited


def version(**parts: str) -> Version:
    return Version.make(lambda: parts)


def marks(shown: Version) -> list[str]:
    return [part.mark for part in shown.parts]


def test_a_page_that_shows_the_newest_version_is_sent_nothing():
    assert version(a="1", b="2").beyond(marks(version(a="1", b="2"))) is None


def test_only_parts_that_changed_are_sent_and_the_order_of_all():
    changes = version(b="2", c="3", a="4").beyond(marks(version(a="1", b="2")))
    assert changes is not None
    assert [name for name, _ in changes["order"]] == ["b", "c", "a"]
    assert sorted(changes["changed"].values()) == ["3", "4"]


def test_a_page_that_shows_nothing_known_is_sent_everything():
    changes = version(a="1", b="2").beyond(["?"])
    assert changes is not None and len(changes["changed"]) == 2


def test_a_version_that_was_dear_to_make_is_looked_for_less_often(monkeypatch):
    # 0.6 s of work may take 1 % of a core, so the pause is 60 s.
    clock = iter([0.0, 0.6])
    monkeypatch.setattr("openeureka.ui.follow.time.thread_time", lambda: next(clock))
    first = version(a="1")
    assert first.pause == PAUSE
    clock = iter([0.0, 0.6])
    assert Version.make(lambda: {"a": "2"}, first).pause == pytest.approx(60.0)
    clock = iter([0.0, 0.001])
    assert Version.make(lambda: {"a": "3"}, first).pause == PAUSE


def test_parts_that_become_alike_are_each_renewed():
    changes = version(a="", b="").beyond(marks(version(a="", b="2")))
    assert changes is not None and list(changes["changed"].values()) == [""]


def test_a_value_is_made_again_from_the_one_before_when_its_fingerprint_differs():
    fresh: Fresh[list[int]] = Fresh(2)
    assert fresh.get("x", (1,), lambda before: [*(before or ()), 1]) == [1]
    assert fresh.get("x", (1,), lambda before: [*(before or ()), 2]) == [1]
    assert fresh.get("x", (2,), lambda before: [*(before or ()), 2]) == [1, 2]


def test_what_was_not_asked_for_longest_is_forgotten():
    fresh: Fresh[str] = Fresh(2)
    for key in ("a", "b", "a", "c"):
        fresh.get(key, (), lambda _: "first")
    made = {key: fresh.get(key, (), lambda _: "again") for key in ("a", "c")}
    assert made == {"a": "first", "c": "first"}
    assert fresh.get("b", (), lambda _: "again") == "again"


def test_events_tell_only_of_changes_and_end_when_nobody_listens(monkeypatch):
    monkeypatch.setattr("openeureka.ui.follow.PAUSE", 0.0)
    versions = [version(a="1"), version(a="1"), version(a="2"), version(a="2")]
    left = list(versions)

    async def gone() -> bool:
        return not left

    async def listen() -> list[str]:
        return [event async for event in events(lambda: left.pop(0), [], gone)]

    first, second = awaited(listen())
    assert first.startswith("data: ") and first.endswith("\n\n")
    assert json.loads(first.removeprefix("data: "))["changed"] == {marks(versions[0])[0]: "1"}
    assert list(json.loads(second.removeprefix("data: "))["changed"].values()) == ["2"]


def test_a_page_without_news_hears_a_sign_of_life(monkeypatch):
    monkeypatch.setattr("openeureka.ui.follow.BEAT", 0.0)
    monkeypatch.setattr("openeureka.ui.follow.PAUSE", 0.0)
    left = iter([False, True])

    async def gone() -> bool:
        return next(left)

    async def listen() -> list[str]:
        return [event async for event in events(lambda: version(a="1"), marks(version(a="1")), gone)]

    assert awaited(listen()) == ["event: beat\ndata: here\n\n"]


def test_a_page_that_is_looked_at_seldom_hears_signs_of_life_between(monkeypatch):
    monkeypatch.setattr("openeureka.ui.follow.BEAT", 0.0)
    monkeypatch.setattr("openeureka.ui.follow.PAUSE", 0.0)
    seen, left = Version(parts=version(a="1").parts, pause=60.0), iter([False, False, True])

    async def gone() -> bool:
        return next(left)

    async def listen() -> list[str]:
        return [event.partition("\n")[0] async for event in events(lambda: seen, marks(seen), gone)]

    assert awaited(listen()) == ["event: beat", "event: beat"]
