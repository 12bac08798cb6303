import pytest

from openeureka.errors import BudgetError, ConfigError
from openeureka.llm import price
from openeureka.llm.price import Price
from openeureka.types import Message, Prompt, Reply, Usage

PROMPT = Prompt(messages=(Message("system", "s" * 40), Message("user", "u" * 40)))


def test_cost_is_per_million_tokens():
    # 1000 tokens at 2 $/M and 200 at 10 $/M: 0.002 + 0.002
    assert Price(2.0, 10.0).of(1000, 200) == pytest.approx(0.004)


def test_dated_versions_share_a_price_and_other_models_do_not():
    assert price.find("gpt-4o-2024-08-06") == price.find("gpt-4o") is not None
    assert price.find("gpt-4o-2024-05-13") == Price(5.0, 15.0)
    assert price.find("gpt-4-0314") == price.find("gpt-4")
    assert price.find("gpt-5-unheard-of") is None


def test_a_stated_price_goes_before_the_table():
    assert price.find("gpt-4o", "1,2.5") == Price(1.0, 2.5)


@pytest.mark.parametrize("stated", ["1", "a,b", "1,2,3", "-1,2", "nan,1", "inf,1"])
def test_other_prices_are_refused(stated: str):
    with pytest.raises(ConfigError, match="must be two numbers"):
        price.find("m", stated)


def paid(*costs: float) -> list[Reply]:
    return [Reply(text="x", model="m", usage=Usage(cost_usd=cost)) for cost in costs]


def test_max_cost_stops_before_the_first_request():
    # A reply is first guessed at 1500 tokens: 2 of them cost 2 * 1500 * 10 / 1e6 = 0.03 dollars.
    price.afford(0.03, [], Price(0.0, 10.0), PROMPT, 2)
    with pytest.raises(BudgetError, match=r"2 more replies would cost about 0\.03 .* max_cost=0\.02: 0\.00 are spent"):
        price.afford(0.02, [], Price(0.0, 10.0), PROMPT, 2)
    # The prompt's 80 characters are 20 tokens, paid once: 20 * 1000 / 1e6 = 0.02 dollars.
    price.afford(0.021, [], Price(1000.0, 0.0), PROMPT, 8)
    with pytest.raises(BudgetError):
        price.afford(0.019, [], Price(1000.0, 0.0), PROMPT, 8)


def test_max_cost_counts_what_is_spent_and_learns_what_replies_cost():
    # At 0.01 dollars a reply, 1.505 dollars are enough for 150 replies and not for 151. The first was guessed at 1.50.
    known = Price(0.0, 1000.0)
    price.afford(1.505, [], known, PROMPT, 1)
    price.afford(1.505, paid(*[0.01] * 149), known, PROMPT, 1)
    with pytest.raises(BudgetError):
        price.afford(1.505, paid(*[0.01] * 150), known, PROMPT, 1)


def test_where_no_price_is_known_what_was_paid_says_it():
    price.afford(0.035, [], None, PROMPT, 100)
    price.afford(0.035, paid(0.01, 0.01), None, PROMPT, 1)
    with pytest.raises(BudgetError):
        price.afford(0.035, paid(0.01, 0.01), None, PROMPT, 2)


def test_a_reply_that_nobody_paid_for_says_nothing_of_the_price():
    with pytest.raises(BudgetError, match=r"about 0\.03 "):
        price.afford(0.02, paid(0.0), Price(0.0, 10.0), PROMPT, 2)
