"""Which numbers in the text of a reward may be tuned, and the text with other numbers in their place."""

import math
from pathlib import Path

import pytest

import openeureka
from openeureka.reward import gate, load, probe
from openeureka.reward.weights import GUARD, THRESHOLD, values, weighed, weights
from openeureka.tasks import human
from openeureka.tasks.record import record_states
from openeureka.tasks.registry import get

REWARDS = sorted((Path(openeureka.__file__).parent / "suite" / "rewards").glob("*.py"))
GOLDEN = {
    "ant": {
        "FALL_HEIGHT": 0.31, "posture 0.5": 0.5, "posture 0.8": 0.8, "posture 0.1": 0.1, "posture 0.93": 0.93,
        "effort 0.005": 0.005, "energy 0.05": 0.05, "at_limit 0.1": 0.1, "at_limit 0.99": 0.99, "reward 0.5": 0.5,
        "reward -2.0": -2.0,
    },
    "catch": {"reward -0.2": -0.2, "reward 50.0": 50.0},
    "shadow_hand_re_orientation": {
        "turned 1.0": 1.0, "turned 0.1": 0.1, "turned 1.0 (2)": 1.0, "turned 0.1 (2)": 0.1, "bonus 500.0": 500.0,
        "bonus 0.1": 0.1, "reward -10.0": -10.0, "reward 0.0002": 0.0002,
    },
}  # fmt: skip


def reward(*lines: str, before: str = "") -> str:
    body = "".join(f"    {line}\n" for line in lines)
    return f"{before}def compute_reward(x, y):\n{body}"


def found(text: str) -> dict[str, float]:
    return {weight.name: weight.value for weight in weights(text)}


@pytest.mark.parametrize("name", GOLDEN)
def test_the_numbers_of_a_human_reward(name):
    (path,) = [path for path in REWARDS if path.stem == name]
    assert found(path.read_text()) == GOLDEN[name]


@pytest.mark.parametrize("path", REWARDS, ids=lambda path: path.stem)
def test_every_human_reward_has_numbers_that_can_be_changed_and_changed_back(path):
    text = path.read_text()
    own = weights(text)
    assert own and len({weight.name for weight in own}) == len(own)
    assert weighed(text, [weight.value for weight in own]) == text
    moved = [weight.value * 1.5 for weight in own]
    assert values(weighed(text, moved), text) == tuple(moved)


@pytest.mark.parametrize("env", ["ant", "anymal"])
def test_numbers_changed_and_changed_back_trace_to_the_same_graph(env):
    task = get(env)
    text = human.program(task)
    own = [weight.value for weight in weights(text)]
    back = weighed(weighed(text, [value * 3.0 for value in own]), own)
    assert back != text or env == "ant"  # 2.5e-5 is written 2.5e-05
    programs = [gate.check(one, task.spec) for one in (text, back, weighed(text, [value * 1.1 for value in own]))]
    states = record_states(env)
    first, again, other = (
        probe.probe(load.load(program), task.spec, states, task.recipe.worlds).graph
        for program in programs
        if isinstance(program, gate.Program)
    )
    assert first == again and first != other


@pytest.mark.parametrize(
    ("line", "numbers"),
    [
        ("return 2 * x / 3", {"reward 2": 2.0, "reward 3": 3.0}),
        ("return x + 2", {}),  # a whole number that is added may be a count
        ("return x + 2.0 - 0.5", {"reward 2.0": 2.0, "reward 0.5": 0.5}),
        ("return x ** 2.0 + x.pow(0.5) + torch.square(x)", {}),
        ("return x[:, 0] * x[..., 1:3].sum(dim=-1)", {}),
        ("return torch.zeros(2 * 3) + x.view(3, -1) + torch.full_like(x, 0.5)", {}),
        ("return x.clamp(min=0.1, max=0.5) + torch.clamp(x, 0.0, 1.0)", {}),
        ("return (0.5 * x).clamp(min=0.0).sum(dim=-1)", {"reward 0.5": 0.5}),
        ("return torch.where(x > 0.3, -2.0, 0.0 * y)", {"reward 0.3": 0.3, "reward -2.0": -2.0}),
        ("return torch.exp(-x / 0.25)", {"reward 0.25": 0.25}),
        ("return 1.0 / (x + 1e-6)", {"reward 1.0": 1.0}),
        ("return 2e-7 * x", {"reward 2e-7": 2e-7}),
        ("return (x - torch.tensor([0.1, 0.2])).norm(dim=-1)", {}),
        ("return x * True", {}),
        ("return x * 0x10", {}),
    ],
)
def test_what_weighs_or_scales_and_what_does_not(line, numbers):
    assert found(reward(line)) == numbers


def test_a_named_number_is_an_option_where_a_written_one_would_be():
    before = "POWER = 2.0\nCAP = 0.5\nKIND = 2.0\nSCALE = 3.0\n"
    text = reward(
        "z = SCALE * x ** POWER", "return torch.clamp(z, max=CAP) + torch.norm(y, p=KIND) * 0.25", before=before
    )
    assert found(text) == {"SCALE": 3.0, "reward 0.25": 0.25}


def test_a_number_that_a_size_or_a_place_is_computed_from_is_none():
    before = "ROWS = 3\nCUT = 2\nTURNS = 4\nLOW = 0.5\n"
    lines = ("z = x.view(-1, ROWS * 2)[:, :CUT] * ROWS", "for i in range(TURNS * 2):", "    z[y < LOW] *= 1.5")
    assert found(reward(*lines, "return z / CUT", before=before)) == {"LOW": 0.5, "reward 1.5": 1.5}


@pytest.mark.parametrize(
    "lines",
    [
        ("start = 2 * leg", "return 0.5 * x[:, start:start + 2]"),
        ("start, end = 2 * leg, 2 * leg + 2", "return 0.5 * x[:, start:end]"),
        ("first = JOINTS * 1", "z = JOINTS * y", "return 0.5 * x[:, first]"),
        ("first = 3 * JOINTS", "last = first + 2 * 3", "return 0.5 * x.narrow(1, first, last - first)"),
        ("start = 0", "start += 2 * leg", "return 0.5 * x[:, start]"),
        ("for start in range(0, 2 * 3):", "    z = x[:, start]", "return 0.5 * z"),
        ("for start in [2 * leg for leg in range(3)]:", "    z = x[:, start]", "return 0.5 * z"),
        ("return 0.5 * x[:, place(leg)]",),
        ("return 0.5 * part(x, 2 * leg)",),
        ("half = int(0.25 * size * 2)", "return 0.5 * x[:, :half]"),
    ],
)
def test_no_number_by_which_a_place_is_reached_weighs(lines):
    before = (
        "JOINTS = 3\n\n\ndef place(leg):\n    return 2 * leg\n\n\n"
        "def part(z, first):\n    return z[:, first:first + 2]\n\n\n"
    )
    assert found(reward(*lines, before=before)) == {"reward 0.5": 0.5}


def test_what_a_place_is_chosen_by_still_weighs():
    """Numbers count if a comparison, argmax or `.long()` comes between them and an index, or an index is a name."""
    lines = (
        'terms = {"near": 4 * x}',
        "for name in terms:",
        "    z = terms[name]",
        "score = 2 * x + 0.5 * y",
        "low = y < 3 * 0.1",
        "bins = (10 * y).long()",
        "return score.gather(1, score.argmax(dim=-1)) + x[low] + x[bins]",
    )
    assert found(reward(*lines)) == {
        "near 4": 4, "score 2": 2, "score 0.5": 0.5, "low 3": 3, "low 0.1": 0.1, "bins 10": 10,
    }  # fmt: skip


def test_a_method_that_the_reward_calls_has_numbers_too():
    helper = "def shaping(self, x):\n    return 0.75 * x\n\n\n"
    assert found(f"{helper}def compute_reward(self):\n    return self.shaping(self.x) * 2.5\n") == {
        "shaping 0.75": 0.75,
        "reward 2.5": 2.5,
    }


def test_a_number_has_the_name_that_it_is_assigned_to():
    text = reward(
        "w_speed, w_effort = 2.0, 0.1",
        'scales = {"near": 0.2}',
        "near: float = torch.exp(-x / 0.3)",
        'parts["far"] = 0.4 * y',
        "near += 0.5",
        "return near * w_speed - TOP * helper(x) * gain",
        before="TOP = 3.0\nIDLE = 4.0\ngain = 5\n"
        "def helper(z, margin=0.7):\n    return 0.8 * z\n"
        "def unread(z):\n    return 6.0 * z\n",
    )
    assert list(found(text)) == [
        *("TOP", "gain", "margin", "helper 0.8"),
        *("w_speed", "w_effort", "near", "near 0.3", "far 0.4", "near 0.5"),
    ]


def test_thresholds_move_in_small_steps():
    text = reward("tall = 0.3", "return torch.where((x > tall) & (y < 2 * 0.4), 0.5 * x, y)")
    steps = {weight.name: weight.step for weight in weights(text)}
    assert steps == {"tall": THRESHOLD, "reward 2": THRESHOLD, "reward 0.4": THRESHOLD, "reward 0.5": 1.0}


def test_all_but_the_numbers_stays_to_the_byte():
    text = "# größe\r\n" + reward("é = -0.5*x  # 0.5 weighs", "return é   +1.5").replace("\n", "\r\n")
    assert weighed(text, [-0.25, 3.0]) == text.replace("-0.5*x", "-0.25*x").replace("+1.5", "+3.0")


def test_a_sign_stays_where_it_is():
    assert weighed(reward("return -2.0 * x"), [3.0]) == reward("return -3.0 * x")


def test_another_text_is_no_weighting():
    text = reward("return 2.0 * x")
    assert values(reward("return 2.5 * x"), text) == (2.5,)
    assert values(reward("return 1_0.0 * x"), text) == (10.0,)
    for other in (
        reward("return 2.5 * y"),
        reward("return z * x"),
        text + "# more",
        "",
        "\ud800",
        reward("return 1e999 * x"),
    ):
        assert values(other, text) is None


@pytest.mark.parametrize(
    "text", ["", "no python at all", "x = 0.5", "\ud800", "\0", "(" * 300, f"x = {'-' * 5000}1.0", "a\n" * 20_001]
)
def test_what_is_no_reward_has_no_numbers(text):
    assert weights(text) == ()


def test_numbers_that_keep_a_division_from_zero_stay():
    assert found(reward(f"return x / (y + {GUARD})")) == {}
    assert math.isclose(found(reward(f"return x / (y + {2 * GUARD})"))["reward 2e-05"], 2e-5)


@pytest.mark.parametrize("line", ["NEAR, FAR = 0.25, 0.5\n", "(NEAR, FAR) = (0.25, 0.5)\n"])
def test_constants_on_one_line_are_weights_each(line):
    assert found(reward("return NEAR * x + FAR * y, {}", before=line)) == {"NEAR": 0.25, "FAR": 0.5}


def test_a_constant_of_two_names_is_a_weight_whichever_is_read():
    assert found(reward("return B * x, {}", before="A = B = 0.25\n")) == {"A": 0.25}
