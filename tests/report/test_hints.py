import dataclasses

from openeureka.report.charts import components
from openeureka.report.hints import hints, shares
from openeureka.types import TrainingResult

from .search import result

EPOCHS = range(100)


def trained(correlation: float = 0.5, **curves: list[float | None]) -> TrainingResult:
    named = {name.replace("__", "/"): tuple(curve) for name, curve in curves.items()}
    return dataclasses.replace(result("a", 1.0), curves=named, correlation=correlation)


def test_a_component_that_never_moved_is_named():
    found = hints(trained(component__still=[0.0] * 100))
    assert found == ("still was always 0: it teaches nothing.",)


def test_a_component_that_pays_every_step_alike_is_not_said_to_teach_nothing():
    found = hints(trained(component__alive=[0.5] * 100))
    assert found == ("alive stayed at 0.5: it only rewards or punishes long episodes.",)


def test_f_that_falls_while_the_own_reward_rises_is_told():
    fitness = [min(n, 150 - 2 * n) for n in EPOCHS]  # 50 at epoch 50, then down to -48
    told = hints(trained(fitness=fitness, reward=list(EPOCHS)))
    assert len(told) == 1 and told[0].startswith("F fell from 50 at epoch 50 to -")
    assert hints(trained(fitness=fitness, reward=[-n for n in EPOCHS])) == ()
    assert hints(trained(fitness=fitness, reward=list(EPOCHS)), best=950.0) == told  # F spans 98: more than a tenth
    assert hints(trained(fitness=fitness, reward=list(EPOCHS)), best=1000.0) == ()  # less: noise


def test_f_that_still_rises_is_told_and_one_that_is_flat_is_not():
    assert any(
        "still rises" in hint for hint in hints(trained(fitness=list(EPOCHS[:80]) + [80 + 5 * n for n in range(20)]))
    )
    assert hints(trained(fitness=[min(n, 50) for n in EPOCHS])) == ()


def test_a_reward_against_the_human_one_is_told():
    assert "negatively correlated" in hints(trained(-0.4, fitness=[min(n, 50) for n in EPOCHS]))[0]


def test_one_component_that_outweighs_the_others_is_named_with_its_share():
    found = trained(component__big=[95.0 + n % 3 for n in EPOCHS], component__small=[-4.0 - n % 3 for n in EPOCHS])
    # The last tenth, epochs 90 to 99: means 95.9 and -4.9.
    assert round(shares(found)["big"], 4) == round(95.9 / 100.8, 4)
    assert hints(found) == ("big makes up 95% of what the components pay: the others hardly count.",)


def test_components_that_do_not_add_up_to_the_reward_have_no_shares():
    parts = {"component__near": [0.9] * 50 + [1.0] * 50, "component__effort": [7.0] * 50 + [8.0] * 50}
    assert shares(trained(**parts, reward=[9.0] * 100)) == {"near": 1 / 9, "effort": 8 / 9}
    weighed = trained(**parts, reward=[0.92] * 100)  # near - 0.01 * effort
    assert shares(weighed) == {} and not any("makes up" in hint for hint in hints(weighed))
    drawn = components(weighed), components(trained(**parts, reward=[9.0] * 100))
    assert [chart.note for chart in drawn if chart] == ["The components do not add up to the reward.", ""]


def test_a_short_training_and_none_say_nothing():
    assert hints(None) == () and shares(None) == {}
    assert hints(trained(fitness=[1.0, 2.0], component__still=[0.5, 0.5])) == ()
