import pytest

from openeureka.config import RunConfig, as_dict, parse
from openeureka.errors import ConfigError


def test_words_become_typed_fields():
    config = parse(
        RunConfig, ["env=ant", "sample=16", "max_cost=1.5", "unsafe_no_sandbox=true", "base_url=http://h/v?a=b"]
    )
    assert (config.env, config.sample, config.max_cost) == ("ant", 16, 1.5)
    assert config.unsafe_no_sandbox is True
    assert config.base_url == "http://h/v?a=b"


def test_a_config_survives_being_stored_and_read_back():
    config = parse(RunConfig, ["env=ant", "seeds=5"])
    assert RunConfig(**as_dict(config)) == config  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("word", "says"),
    [
        ("sampel=3", "Did you mean `sample`?"),
        ("sample=many", "`sample` takes a whole number"),
        ("steps=1.5", "`steps` takes a whole number"),
        ("steps=1e-6", "`steps` takes a whole number"),
        ("max_cost=much", "`max_cost` takes a number"),
        ("sample=-1", "`sample` must be zero or more"),
        ("ant", "not of the form key=value"),
        ("search=greedy", "`search` must be one of best, eureka"),
        ("bonus=250", "`bonus` must be one of none, original"),
        ("seeds=0", "`seeds` must be one or more"),
    ],
)
def test_a_wrong_word_is_one_sentence_that_says_what_to_do(word: str, says: str):
    with pytest.raises(ConfigError, match=r"^[^\n]*$") as error:
        parse(RunConfig, [word])
    assert says in str(error.value)


@pytest.mark.parametrize(("text", "steps"), [("1e6", 1_000_000), ("2.5e5", 250_000), ("1E3", 1000), ("7", 7)])
def test_whole_numbers_may_be_written_with_an_exponent(text: str, steps: int):
    assert parse(RunConfig, [f"steps={text}"]).steps == steps
