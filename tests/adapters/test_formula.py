import pytest
import torch

pytest.importorskip("gymnasium", reason="needs Gymnasium: pip install 'openeureka[gym]'")

from openeureka.adapters.gym.formula import formula
from openeureka.errors import TaskError
from openeureka.tasks.record import record_states

SHAPES = {"speed": (), "place": (3,)}
VALUES = {"speed": torch.tensor([2.0, -1.0]), "place": torch.tensor([[0.0, 1.0, 4.0], [0.0, 0.0, 9.0]])}


@pytest.mark.parametrize(
    "text, expected",
    [
        ("speed", [2.0, -1.0]),
        ("speed - 0.5 * abs(place[1])", [1.5, -1.0]),
        ("-speed ** 2 + sqrt(place[2])", [-2.0, 2.0]),
        ("max(speed, 0.0) / 2", [1.0, 0.0]),
        ("speed > 0", [1.0, 0.0]),
    ],
)
def test_arithmetic_by_hand(text: str, expected: list[float]):
    function, names = formula(text, SHAPES)
    assert function(VALUES).tolist() == expected and names <= SHAPES.keys()


def test_a_score_that_is_no_number_everywhere_is_refused_before_anything_is_asked():
    with pytest.raises(TaskError, match=r"not finite in some states of random play; .* log\(max\(x, 0.01\)\)"):
        record_states("gym:Hopper-v5+fitness=log(x_velocity)")
    record_states("gym:Hopper-v5+fitness=log(max(x_velocity, 0.01))", worlds=8)


@pytest.mark.parametrize("number", ["1e400", "1e39", "9" * 400])
def test_a_number_that_is_infinite_in_32_bits_is_refused(number: str):
    with pytest.raises(TaskError, match=r"^The fitness `.*` has a number beyond 3\.4e38; write a smaller one\.$"):
        formula(f"speed * {number}", SHAPES)


@pytest.mark.parametrize("text", ["plce", "plce[1]"])
def test_a_name_that_is_not_there_is_told_with_the_one_that_may_be_meant(text: str):
    with pytest.raises(
        TaskError, match=r"uses `plce`, which .* did not report in random play\. Did you mean `place`\?"
    ):
        formula(text, SHAPES)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("-" * 1990 + "speed", "nested too deeply; write fewer than 200 operations in a row"),
        ("+".join(["speed"] * 201), "nested too deeply"),
        ("-" * 2000 + "speed", "too long; write at most 2000 characters"),
        ("place[0x" + "f" * 1990 + "]", "so it has no column 1"),
        ("speed + 0x" + "f" * 1980, "a number beyond"),
    ],
)
def test_an_expression_without_end_is_one_sentence(text: str, why: str):
    with pytest.raises(TaskError, match=why):
        formula(text, SHAPES)
    function, _ = formula("+".join(["speed"] * 200), SHAPES)
    assert function(VALUES).tolist() == [400.0, -200.0]


REFUSED = """
speed.real | speed() | [speed] | lambda: speed | speed if speed else 1 | place | place[9] | place[-1] | sped | 1 | 'a'
abs(speed, speed) | speed and speed | speed = 1 | open(speed) | speed @ speed | ((((speed
"""


@pytest.mark.parametrize("text", [text for line in REFUSED.strip().splitlines() for text in line.split(" | ")])
def test_nothing_else_is_understood(text: str):
    with pytest.raises(TaskError):
        formula(text, SHAPES)
