from dataclasses import asdict

import pytest

from openeureka.config import RobustConfig, RunConfig, TrainConfig, TuneConfig
from openeureka.errors import ConfigError
from openeureka.parsing import changed, literal, parse, restored, taken


def test_words_become_typed_fields():
    config = parse(
        RunConfig, ["env=ant", "sample=16", "max_cost=1.5", "unsafe_no_sandbox=true", "base_url=http://h/v=b"]
    )
    assert (config.env, config.sample, config.max_cost) == ("ant", 16, 1.5)
    assert config.unsafe_no_sandbox is True
    assert config.base_url == "http://h/v=b"


def test_a_place_at_home_is_found_whatever_the_shell(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert parse(RunConfig, ["dir=~/runs/a"]).dir == f"{tmp_path}/runs/a"
    assert parse(RunConfig, ["init=~/mine.py"]).init == f"{tmp_path.resolve()}/mine.py"
    assert parse(TrainConfig, ["reward=human,~/mine.py"]).reward == f"human,{tmp_path}/mine.py"
    assert parse(RunConfig, ["init=~nobody.py"]).init.endswith("/~nobody.py")  # a file of that name, not a user's home


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("(0.8, 2)", [0.8, 2]),
        ("{'a': (1, None)}", {"a": [1, None]}),
        ("[1, true]", [1, True]),
        ("None", None),
        *((text, text) for text in ("(b)", "{1, 2}", "(1j,)", "1_000", "[" * 9999)),
    ],
)
def test_a_value_is_json_or_python_and_any_other_text_itself(text: str, value: object):
    assert literal(text) == value


def test_a_config_survives_being_stored_and_read_back():
    config = parse(RunConfig, ["env=ant", "seeds=5"])
    assert RunConfig(**asdict(config)) == config  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("word", "says"),
    [
        ("sampel=3", "Did you mean `sample`?"),
        ("sample=many", "`sample` takes a whole number"),
        ("steps=1.5", "`steps` takes a whole number"),
        ("steps=1M", "`steps` takes a whole number, such as 8 or 1e6"),
        ("ENV=ant", "Unknown setting `ENV`. Did you mean `env`?"),
        ("steps=1e-6", "`steps` takes a whole number"),
        ("max_cost=much", "`max_cost` takes a number"),
        ("sample=-1", "`sample` must be from 0 to 100,000, not -1."),
        ("ant", "not of the form key=value"),
        ("bonus=250", "`bonus` must be one of none, original, progress"),
        ("seeds=0", "`seeds` must be from 1 to 100,000, not 0."),
        ("sample=1000000", "`sample` must be from 0 to 100,000"),
        ("screen=0", "`screen` must be from 1 to 100,000, not 0; 1 trains every reward."),
        ("sample=1.5", "`sample` takes a whole number"),
        ("sample=", "`sample` takes a whole number"),
        (f"sample={'9' * 5000}", "`sample` takes a whole number"),
        ("max_cost=much", "`max_cost` takes a number"),
        ("seed=-1", "`seed` must be from 0 to 4,503,599,627,370,496"),
        ("seed=99999999999999999999", "`seed` must be from 0 to 4,503,599,627,370,496"),
        ("max_cost=nan", "`max_cost` must be from 0 to 1,000,000,000, not nan; 0 sets no limit."),
        ("temperature=inf", "`temperature` must be from 0 to 100, not inf."),
        ("temperature=-1", "`temperature` must be from 0 to 100, not -1.0."),
        ("polish_steps=1e18", "`polish_steps` must be from 0 to 9,007,199,254,740,991"),
        ("threads=100000", "`threads` must be from 0 to 1,024, not 100000; 0 takes all cores."),
        ("worlds=2e6", "`worlds` must be from 0 to 1,048,576"),
        ("steps=1e16", "`steps` must be from 0 to 9,007,199,254,740,991"),
        ("unsafe_no_sandbox=perhaps", "`unsafe_no_sandbox` takes true or false"),
    ],
)
def test_a_wrong_word_is_one_sentence_that_says_what_to_do(word: str, says: str):
    with pytest.raises(ConfigError, match=r"^[^\n]*$") as error:
        parse(RunConfig, [word])
    assert says in str(error.value)


@pytest.mark.parametrize("text", ["x" * 4097, "a\0b"])
def test_a_text_that_no_run_could_give_back_is_refused_before_it_is_kept(text: str):
    with pytest.raises(ConfigError, match="^`safety` h[^\n]*$"):
        taken(RunConfig, {"safety": text})
    with pytest.raises(ConfigError, match="^`safety` h[^\n]*$"):
        parse(RunConfig, [f"safety={text}"])
    longest = parse(RunConfig, ["safety=" + 4096 * "x"])
    assert restored(RunConfig, asdict(longest)) == longest


@pytest.mark.parametrize("last", ["ant", "cartpole"])
def test_a_setting_is_said_once(last: str):
    words = ["env=cartpole", "sample=2", f"env={last}"]
    says = f"`env` is set twice, to `cartpole` and to `{last}`; set it once."
    with pytest.raises(ConfigError, match=f"^{says}$"):
        parse(RunConfig, words)
    with pytest.raises(ConfigError, match=f"^{says}$"):
        changed(RunConfig(), words)


@pytest.mark.parametrize("word", ["seed=-1", "threads=100000", "worlds=2e6", "steps=1e16"])
def test_trainings_of_given_rewards_refuse_what_a_search_refuses(word: str):
    with pytest.raises(ConfigError, match="must be"):
        parse(TrainConfig, [word])


@pytest.mark.parametrize(
    ("word", "says"),
    [
        ("max_cost=nan", "`max_cost` must be from 0 to"),
        ("sample=0", "`sample` must be from 1 to 1,000, not 0."),
        ("repair=-1", "`repair` must be from 0 to"),
        ("threads=-1", "not -1; 0 takes those of the run."),
    ],
)
def test_a_hardening_says_its_own_bounds(word: str, says: str):
    with pytest.raises(ConfigError, match=says):
        parse(RobustConfig, [word])


@pytest.mark.parametrize(("text", "steps"), [("1e6", 1_000_000), ("2.5e5", 250_000), ("1E3", 1000), ("7", 7)])
def test_whole_numbers_may_be_written_with_an_exponent(text: str, steps: int):
    assert parse(RunConfig, [f"steps={text}"]).steps == steps


@pytest.mark.parametrize(
    "value", ["${oc.env:HOME}", "http://h/${oc.env:OPENAI_API_KEY}/v1", "${seed}", "???", "\\${x}", "null"]
)
def test_a_value_is_text_and_nothing_in_it_is_looked_up(value: str):
    assert parse(RunConfig, [f"address={value}"]).address == value


@pytest.mark.parametrize(
    ("word", "value"),
    [
        ("true", True),
        ("Yes", True),
        ("on", True),
        ("1", True),
        ("false", False),
        ("No", False),
        ("off", False),
        ("0", False),
    ],
)
def test_a_switch_is_said_in_several_ways(word: str, value: bool):
    assert parse(RunConfig, [f"unsafe_no_sandbox={word}"]).unsafe_no_sandbox is value


@pytest.mark.parametrize(
    ("stored", "error"),
    [
        ({"env": ["ant"]}, TypeError),
        ({"sample": "16"}, TypeError),
        ({"sample": True}, TypeError),
        ({"unsafe_no_sandbox": 1}, TypeError),
        ({"env": "a" * 5000}, TypeError),
        (["env"], TypeError),
        ({"colour": "red"}, ConfigError),
        ({"sample": 10**12}, ConfigError),
    ],
)
def test_stored_settings_that_nobody_stored_are_not_taken(stored: object, error: type[Exception]):
    with pytest.raises(error):
        restored(RunConfig, stored)


def test_stored_settings_are_taken_as_they_are():
    assert restored(RunConfig, {"max_cost": 1, "env": "${x}"}) == RunConfig(max_cost=1, env="${x}")


@pytest.mark.parametrize("kind", [TrainConfig, TuneConfig])
@pytest.mark.parametrize("settings", [{"observe": "foo"}, {"log": "foo"}, {"seeds": 200_000}, {"threads": 5000}])
def test_given_rewards_are_refused_what_a_search_is_refused(kind, settings):
    (name,) = settings
    with pytest.raises(ConfigError, match=f"`{name}` must be"):
        kind(**settings)
