"""What training with ranges gains and costs, from the records of seeds."""

import sys
from typing import Any

import pytest
import robust


def seed(**arms: tuple[float | None, float | None]) -> dict[str, Any]:
    return {"arms": {name: {"nominal": own, "hard": hard} for name, (own, hard) in arms.items()}}


def test_losses_are_shares_of_what_the_plain_policy_has_and_loses():
    seeds = {
        "0": seed(plain=(10.0, 6.0), uniform=(8.0, 7.0), ours=(9.0, 8.0)),
        "1": seed(plain=(10.0, 4.0), uniform=(8.0, 7.0), ours=(10.0, 7.0)),
    }
    ((task, _, count, *scores, _, _, nominal, hard, uniform),) = robust.rows({"best": {"ant": seeds}})
    # 5 % of plain's 10; 50 % and 60 % of the 5 that plain loses in hard worlds
    assert (task, count, nominal, hard, uniform) == ("ant", "2", "5%", "50%", "60%")
    assert "/ 5.0 " in scores[0] and "/ 7.50 " in scores[3]


def test_the_gain_in_hard_worlds_has_an_interval_over_pairs_of_one_seed():
    pairs = {str(i): seed(plain=(9.0, p), uniform=(9.0, 1.0), ours=(9.0, p + gain)) for i, (p, gain) in enumerate(
        ((1.0, 1.0), (5.0, 2.0), (9.0, 3.0)))}  # fmt: skip
    ((*_, gained, without, _, _, _),) = robust.rows({"best": {"ant": pairs}})
    assert without == "-4 (-14 to 5.9)"  # 1 minus 1, 5 and 9: -4 +- 4.303 * 4 / sqrt(3)
    assert gained == "2 (-0.48 to 4.5)"  # 2 +- 4.303 * 1 / sqrt(3), however far apart the seeds are
    ((*_, gained, _, _, _, _),) = robust.rows({"best": {"ant": {"0": pairs["0"]}}})
    assert gained == "-"  # one seed has no interval


def test_of_a_negative_score_less_is_lost_too():
    ((*_, nominal, _, _),) = robust.rows(
        {"best": {"quadcopter": {"0": seed(plain=(-0.5, -0.6), uniform=(-1, -1), ours=(-0.4, -0.6))}}}
    )
    assert nominal == "-20%"


def test_where_plain_loses_nothing_or_a_score_is_undefined_there_is_no_share():
    for plain in ((10.0, 10.0), (10.0, None)):
        anymal = {"0": seed(plain=plain, uniform=(1.0, 1.0), ours=(9.0, 8.0))}
        ((*_, hard, _),) = robust.rows({"best": {"anymal": anymal}})
        assert hard == "-"


def test_trainings_that_began_otherwise_have_rows_of_their_own():
    one = seed(plain=(10.0, 6.0), uniform=(8.0, 7.0), ours=(9.0, 8.0))
    more = seed(plain=(10.0, 6.0), longer=(11.0, 6.0), uniform=(8.0, 7.0), ours=(9.0, 8.0))
    first, second = robust.rows({"scratch": {"ant": {"0": one}}, "best": {"ant": {"0": more}}})
    assert first[:3] == ["ant", "best", "1"] and first[4] == "11 / 6"
    assert second[:3] == ["ant", "scratch", "1"] and second[4] == "-"
    found = robust.drawn({"scratch": {"ant": {"0": one}, "anymal": {"0": one}}, "best": {"ant": {"0": more}}})
    assert found == {"anymal, begun from scratch": {"0": one}, "ant, begun with the best policy": {"0": more}}


def test_a_seed_by_another_model_joins_no_row():
    known = {"0": {"settings": ["model=claude", "base_url=http://localhost/v1", "sample=4"]}}
    robust.refuse_other_settings(known, ["sample=4", "start=scratch", "model=claude"], "ant")
    robust.refuse_other_settings({}, ["model=random"], "ant")
    for words in (["model=random", "sample=4"], ["model=claude", "sample=8"], ["model=claude"]):
        with pytest.raises(SystemExit, match="Seed 0 of ant had model=claude sample=4"):
            robust.refuse_other_settings(known, words, "ant")


def test_it_has_no_model_of_its_own(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setattr(robust, "measure", lambda *_, **__: pytest.fail("something was trained"))
    monkeypatch.setattr(sys, "argv", ["robust.py", "--env", "ant", "--seed", "7"])
    with pytest.raises(SystemExit):
        robust.main()
    assert "no model is named" in capsys.readouterr().err
