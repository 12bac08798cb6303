import pytest

from openeureka.errors import FeedbackError
from openeureka.store.remarks import remark
from openeureka.types import Place, Remark, RemarkKind
from openeureka.ui import actions


def test_a_form_becomes_remarks():
    form = {"words": " too jerky\n", "favourite": "g0s3", "veto": "g1s12", "vote": "g0s3:g0s1", "go": "1"}
    assert set(actions.read(form)) == {
        Remark(kind=RemarkKind.WORDS, text="too jerky"),
        Remark(kind=RemarkKind.FAVOURITE, place=Place(0, 3)),
        Remark(kind=RemarkKind.VETO, place=Place(1, 12)),
        Remark(kind=RemarkKind.VOTE, place=Place(0, 3), over=Place(0, 1)),
        Remark(kind=RemarkKind.GO),
    }


def test_go_comes_last_so_that_no_words_are_left_behind():
    assert [r.kind for r in actions.read({"go": "1", "words": "stop"})] == [RemarkKind.WORDS, RemarkKind.GO]


def test_marks_among_the_words_are_what_they_are_in_a_shell():
    wanted = [remark("veto=g0s1"), remark("favourite=g0s0"), remark("too jerky,\nlet it go"), remark("go")]
    assert actions.read({"words": "veto=g0s1 favourite=g0s0\r\ntoo jerky,\r\nlet it go"}) == tuple(wanted[:3])
    assert actions.read({"words": "veto=g0s1\ngo\nfavourite=g0s0\ntoo jerky,\nlet it go"}) == tuple(wanted)
    assert actions.read({"words": "go"}) == (remark("go"),)
    assert actions.read({"words": "too slow favourite=g0s0"}) == (remark("favourite=g0s0"), remark("too slow"))
    assert actions.read({"words": "set gain=2, please"}) == (remark("set gain=2, please"),)


@pytest.mark.parametrize("words", ["favourit=g0s0", "calmer\nvetoe=g0s1", "gain=2"])
def test_a_misspelt_mark_does_not_become_words_for_the_model(words):
    with pytest.raises(FeedbackError, match=r"^There is no mark `\w+=`\."):
        actions.read({"words": words})


@pytest.mark.parametrize("form", [{}, {"words": "  "}])
def test_an_empty_form_is_refused(form):
    with pytest.raises(FeedbackError, match="Nothing was said"):
        actions.read(form)


@pytest.mark.parametrize("place", ["", "3", "g0", "g0s1x", "g-1s0", "g99999999999s0", "g0s1:g0s2", "<b>"])
def test_what_is_no_candidate_is_refused(place):
    with pytest.raises(FeedbackError, match="names no candidate"):
        actions.read({"favourite": place})


def test_a_vote_is_between_two():
    with pytest.raises(FeedbackError, match="votes for a candidate over itself"):
        actions.read({"vote": "g0s1:g0s1"})


@pytest.mark.parametrize("vote", ["g0s1", "g0s1:", ":g0s1"])
def test_a_vote_names_two(vote):
    with pytest.raises(FeedbackError, match="does not name two candidates"):
        actions.read({"vote": vote})
