import pytest

from openeureka.errors import ConfigError
from openeureka.llm import price
from openeureka.llm.price import Price


def test_cost_is_per_million_tokens():
    # 1000 tokens at 2 $/M and 200 at 10 $/M: 0.002 + 0.002
    assert Price(2.0, 10.0).of(1000, 200) == pytest.approx(0.004)


def test_dated_versions_share_a_price_and_other_models_do_not():
    assert price.find("gpt-4o-2024-08-06") == price.find("gpt-4o") is not None
    assert price.find("gpt-4-0314") == price.find("gpt-4")
    assert price.find("gpt-5-unheard-of") is None


def test_a_stated_price_goes_before_the_table():
    assert price.find("gpt-4o", "1,2.5") == Price(1.0, 2.5)


@pytest.mark.parametrize("stated", ["1", "a,b", "1,2,3", "-1,2", "nan,1", "inf,1"])
def test_other_prices_are_refused(stated: str):
    with pytest.raises(ConfigError, match="must be two numbers"):
        price.find("m", stated)
