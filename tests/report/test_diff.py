import dataclasses

from openeureka.report import html

from .search import trained, view


def changed(old: str, new: str) -> list[tuple[str, ...]]:
    child = view(trained(1, 0, 1.0, source=new))
    return [tuple(line) for line in html.changes(dataclasses.replace(child, parent=trained(0, 0, 1.0, old).sample))]


def test_lines_say_what_became_of_them():
    assert changed("a\nb\nc", "a\nx\nc") == [
        ("place", "@@ -1,3 +1,3 @@"),
        ("kept", " a"),
        ("removed", "-b"),
        ("added", "+x"),
        ("kept", " c"),
    ]


def test_an_equal_program_has_no_difference_and_a_first_one_no_parent():
    assert changed("a", "a") == []
    assert html.changes(view(trained(0, 0, 1.0))) == ()


def test_a_program_too_long_to_compare_is_left_alone():
    assert changed("a", "abcdefgh" * 5001) == []
    assert changed("a", "a\n" * 501) == []
    assert changed("a", "a\n" * 500)[0] == ("place", "@@ -1 +1,500 @@")
