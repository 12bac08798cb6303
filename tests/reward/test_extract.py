import json
import time
from itertools import permutations
from pathlib import Path

import pytest

from openeureka.reward import extract
from openeureka.types import Candidate

REWARD = (
    "def compute_reward(x: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:\n    return x, {'x': x}\n"
)
HELPER = "def helper(x):\n    return x\n"
CALLER = "def compute_reward(x):\n    return helper(x), {}\n"


@pytest.mark.parametrize(
    "reply",
    [
        f"```python\n{REWARD}```",
        f"Sure!\n\n```py\n{REWARD}\n```\nThis rewards x.",
        f"~~~\n{REWARD}~~~",
        f"```Python\r\n{REWARD}```".replace("\n", "\r\n").replace("\r\r", "\r"),
        f"````markdown\nLook:\n```python\n{REWARD}```\n````",
        f"```python\n{REWARD}",  # cut off before the closing fence
        f"1. My answer:\n\n   ```python\n{'   ' + REWARD.replace(chr(10), chr(10) + '   ')}\n   ```\n",
        f"1. ```python\n{'   ' + REWARD.replace(chr(10), chr(10) + '   ')}\n   ```\n2. ```bash\n   ls\n   ```\n",
        f"- ```\n{'  ' + REWARD.replace(chr(10), chr(10) + '  ')}\n  ```\n- ```\n  ls\n  ```\n",
        "".join(f"> {line}\n" for line in f"As said:\n\n```python\n{REWARD}```".split("\n")),
        "".join(f">> {line}".rstrip() + "\n" for line in f"```python\n{REWARD}```".split("\n")),
        f"Here you are.\n{REWARD}\nThis rewards x, as you asked.",
        f"<think>```python\ndef compute_reward(y):\n    return y\n```</think>\n```python\n{REWARD}```",
        f"<thinking>```python\ndef compute_reward(y):\n    return y\n```</thinking>\n{REWARD}",
        f"Perhaps\n```python\ndef compute_reward(y):\n    return y\n```\nNo.\n</think>\n\n{REWARD}",
        f"```python\n{REWARD}```\nThat is what I thought.</think>",  # no answer follows, so the draft counts
        f"<think>So.</think>\n```python\n{REWARD}```\nThe mark </think> is no part of it.",
        f"First a draft:\n```python\ndef compute_reward(y):\n    return y\n```\nBetter:\n```python\n{REWARD}```",
        f"```python\n{REWARD}```\nUse it so:\n```python\nloss = -compute_reward(x)[0].mean()\n```",
        f"```python\n{REWARD}```\nInstall:\n```bash\npip install torch\n```",
        f"\ufeff{REWARD}",
        f"```python\n{REWARD}```\nA test:\n```python\ndef test_compute_reward():\n    assert compute_reward(1)\n```",
        f"```python\n{REWARD}```\nTo watch it:\n```python\ndef plot_reward(c):\n    c.plot()\n```",
    ],
)
def test_the_program_is_found(reply: str):
    assert extract.program(reply) == REWARD


def test_helpers_above_and_below_in_the_same_block_stay():
    whole = f"import torch\n\n{HELPER}\n{CALLER}\n{HELPER.replace('helper', 'other')}"
    assert extract.program(f"```python\n{whole}```") == whole


def test_a_helper_in_a_block_of_its_own_comes_along():
    reply = f"A helper:\n```python\n{HELPER}```\nand the reward:\n```python\n{CALLER}```"
    assert extract.program(reply) == f"{HELPER}\n\n{CALLER}"


def test_helpers_that_need_each_other_come_along_in_any_order():
    blocks = [CALLER, HELPER.replace("return x", "return near(x)"), "def near(x):\n    return -x\n"]
    for one, two, three in permutations(blocks):
        helpers = [block for block in (one, two, three) if block != CALLER]
        reply = f"```python\n{one}```\nand\n```python\n{two}```\nand\n```python\n{three}```"
        assert extract.program(reply) == "\n\n".join([*helpers, CALLER])


def test_the_last_of_two_helpers_of_one_name_comes_along():
    draft = HELPER.replace("return x", "return -x")
    reply = f"```python\n{draft}```\nBetter:\n```python\n{HELPER}```\n```python\n{CALLER}```"
    assert extract.program(reply) == f"{HELPER}\n\n{CALLER}"


def test_a_helper_that_is_called_as_a_method_comes_along():
    helper = HELPER.replace("(x)", "(self, x)")
    caller = CALLER.replace("(x):", "(self):").replace("helper(x)", "self.helper(self.x)")
    assert extract.program(f"```python\n{helper}```\n```python\n{caller}```") == f"{helper}\n\n{caller}"


def test_a_helper_that_is_called_a_reward_comes_along():
    helper, caller = (text.replace("helper", "height_reward") for text in (HELPER, CALLER))
    assert extract.program(f"```python\n{helper}```\n```python\n{caller}```") == f"{helper}\n\n{caller}"


def test_a_draft_brings_no_helper():
    draft = f"def compute_reward(y):\n    return y, {{}}\n\n{HELPER}"
    assert extract.program(f"```python\n{draft}```\n```python\n{CALLER}```") == CALLER


def test_a_function_that_is_not_called_does_not_come_along():
    reply = f"```python\ndef unrelated():\n    pass\n```\n```python\n{REWARD}```"
    assert extract.program(reply) == REWARD


FENCE_IN_DOCSTRING = '''def compute_reward(x):
    """Rewards x.

    ```
    reward, components = compute_reward(x)
    ```
    """
    return x, {"x": x}
'''


@pytest.mark.parametrize(
    "reply",
    [
        f"```python\n{FENCE_IN_DOCSTRING}```\nThat is all.",
        f"A draft:\n```python\n{REWARD}```\nBetter:\n```python\n{FENCE_IN_DOCSTRING}```\nRun:\n```bash\nls\n```",
        f"````python\n{FENCE_IN_DOCSTRING}````",
        extract.fenced(FENCE_IN_DOCSTRING),
    ],
)
def test_a_fence_in_a_docstring_ends_no_program(reply: str):
    assert extract.program(reply) == FENCE_IN_DOCSTRING


def test_a_docstring_that_never_ends_hides_no_later_program():
    broken = FENCE_IN_DOCSTRING.replace('"""', "", 1)
    assert extract.program(f"```python\n{broken}```\nNo:\n```python\n{REWARD}```") == REWARD


def test_a_program_in_a_fence_of_its_own_is_found_whole():
    program = FENCE_IN_DOCSTRING.replace("```", "`````")
    assert extract.program(extract.fenced(program)) == program


def test_a_sketch_named_as_a_local_variable_is_no_helper():
    program = "def compute_reward(x):\n    reward = -x\n    return reward, {}\n"
    sketch = "def reward(state):\n    return -np.linalg.norm(state)\n"
    assert extract.program(f"The idea:\n```python\n{sketch}```\n```python\n{program}```") == program


def test_constants_in_a_block_of_their_own_come_along():
    constants, program = "W = 2.0\nK: float = -W / 3\n", "def compute_reward(x):\n    return W * x, {}\n"
    for reply in (f"```python\n{constants}```\n```\n{program}```", f"```\n{program}```\nwith\n```\n{constants}```"):
        assert extract.program(reply) == f"{constants}\n\n{program}"


def test_an_example_that_makes_its_inputs_does_not_come_along():
    program = "def compute_reward():\n    return x, {}\n"
    assert extract.program(f"```\n{program}```\nTry:\n```\nx = torch.zeros(3)\n```") == program


def test_a_signature_that_is_shown_once_more_replaces_no_program():
    recap = 'def compute_reward(x: Tensor) -> Tuple[Tensor, Dict[str, Tensor]]:\n    """Rewards x."""\n    ...\n'
    assert extract.program(f"```python\n{REWARD}```\nAs asked, it is\n```python\n{recap}```") == REWARD


def test_a_byte_order_mark_takes_nothing_from_the_head_of_a_file(tmp_path: Path):
    source = f"W = 2.0\n{REWARD}"
    (tmp_path / "reward.py").write_text(source, encoding="utf-8-sig")
    assert extract.in_file(tmp_path / "reward.py") == (Candidate.of(source), "")
    assert extract.in_text(f"\ufeff{source}").source == source


@pytest.mark.parametrize(
    "reply",
    [
        json.dumps({"code": REWARD}),
        json.dumps({"thoughts": "def is a word", "answer": [{"language": "python", "code": REWARD}]}, indent=2),
        json.dumps({"answer": f"Here it is.\n```python\n{REWARD}```"}),
        json.dumps({"draft": "def compute_reward(y):\n    return y, {}\n", "code": REWARD}),
        '{"code": "' + REWARD + '"}',  # line breaks that JSON would escape
        f"As JSON:\n```json\n{json.dumps({'code': REWARD})}\n```\nThis rewards x.",
        json.dumps({"plan": "none"}) + "\n" + json.dumps({"code": REWARD}),  # two tool calls
    ],
)
def test_a_program_in_a_string_of_json_is_found(reply: str):
    assert extract.program(reply) == REWARD


def test_helpers_in_other_strings_of_json_come_along():
    assert extract.program(json.dumps({"helpers": HELPER, "code": CALLER})) == f"{HELPER}\n\n{CALLER}"


@pytest.mark.parametrize(
    "reply", ["", "I cannot help with that.", "```python\nx = 1\n```", "```\n```", "def", f"<think>{REWARD}</think>No."]
)
def test_a_reply_without_a_function_holds_no_program(reply: str):
    assert extract.program(reply) is None


def test_a_program_with_a_syntax_error_is_returned_for_the_gate_to_explain():
    broken = "def compute_reward(x):\n    return x,, {}\n"
    assert extract.program(f"```python\n{broken}```") == broken


@pytest.mark.parametrize(
    "final",
    [
        "def compute_reward(x):\n    return x,, {}\n",
        "def compute_reward(x):\n    y = x[..., 0]\n    retrun y, {}\n",
        "def compute_reward(x)\n    return x, {}\n",
    ],
)
def test_a_draft_does_not_take_the_place_of_a_final_program_with_a_syntax_error(final: str):
    assert extract.program(f"A draft:\n```python\n{REWARD}```\nFinal:\n```python\n{final}```") == final


@pytest.mark.parametrize(
    "recap",
    [
        "def compute_reward(x: Tensor) -> Tuple[Tensor, Dict[str, Tensor]]:",
        "def compute_reward(\n    x: Tensor,\n)",
        "def compute_reward(...):\n    scale = 0.5  # or less\n    return ...",
        "def compute_reward(x):\n    ...\n    scale = 0.5 or so less\n    return x, {}",
        " def compute_reward(x):\n-    return x, {}\n+    return -x, {}\n     scale = 1",
    ],
)
def test_a_recap_that_does_not_parse_replaces_no_program(recap: str):
    assert extract.program(f"```python\n{REWARD}```\nTo note:\n```python\n{recap}\n```") == REWARD


def test_a_draft_with_a_syntax_error_does_not_take_the_place_of_a_later_reward():
    final = "def my_reward(x):\n    return x, {}\n"
    draft = "def compute_reward(x):\n    return x,, {}\n"
    assert extract.program(f"```python\n{draft}```\nFinal:\n```python\n{final}```") == final


BROKEN = {
    "in the body": f"{HELPER}\n\ndef compute_reward(x):\n    if x is None:\n        return x\n    return 0.5 x, {{}}\n",
    "a bracket": f"{HELPER}\n\ndef compute_reward(x):\n    y = helper(x\n    return y, {{}}\n",
    "below a draft": "import torch\n\n\ndef draft(x):\n    return x, {}\n\n\ndef my_reward(x)\n    return -x, {}\n",
    "below a bracket": f"{HELPER}\n\ndef compute_reward(\n    x,\n):\n    return 0.5 x, {{}}\n",
    "no more indented": "def compute_reward(x):\n    if x: return x\ny = 0.5 x\nreturn y, {}\n",
}


@pytest.mark.parametrize("broken", BROKEN.values(), ids=BROKEN)
def test_without_a_fence_too_nothing_of_a_program_with_a_syntax_error_is_left_out(broken: str):
    assert extract.program(broken) == broken
    assert extract.program(f"Sure!\n\n{broken}\nThat's it.\n") == broken


@pytest.mark.parametrize("head", ["", "\n# My reward.\n\n", '"""My reward."""\n', "W: float = 2.0\n"])
@pytest.mark.parametrize("broken", BROKEN.values(), ids=BROKEN)
def test_nothing_of_a_file_with_a_syntax_error_is_left_out(head: str, broken: str):
    assert extract.in_text(head + broken).source == head + broken


def test_a_syntax_error_in_an_answer_that_was_saved_whole_is_one_of_the_program():
    broken = BROKEN["in the body"]
    assert extract.in_text(f"Here's my reward:\n\n```python\n{broken}```\n").source == broken


@pytest.mark.parametrize(
    "prose",
    [
        "Notes:\n- `x`: what's near\n  - it's smooth",
        "1. First, x.\n   It's near.\n2. Then, nothing.",
        "In short,\n\n    reward = exp(-x²)\n\nwhich doesn't saturate.",
        "Use it so:\n\nimport torch\nprint(compute_reward(x))",
    ],
)
def test_indented_prose_below_a_program_is_left_out(prose: str):
    assert extract.program(f"Here you are.\n{REWARD}\n{prose}\n") == REWARD


@pytest.mark.parametrize(
    "reply",
    [
        "```python\n" * 100_000,
        "`" * 5_000_000,
        ("x" * 99 + "\n") * 50_000,
        "def f(" * 20_000,
        f"```python\n{'(' * 50_000}\n```",
        "import a\n" + "1 +\n" * 200_000,
        "<think>" * 500_000,
        "</think>" * 500_000,
        f"```{' ' * 900_000}`",
        '{"a":' * 180_000,
        "{}\n" * 300_000,
        f"```python\ndef {'reward' * 150_000}",
    ],
)
def test_hostile_replies_take_little_time(reply: str):
    began = time.thread_time()
    extract.program(reply)
    assert time.thread_time() - began < 60.0  # not minutes or hours


@pytest.mark.parametrize(
    ("reply", "settled"),
    [
        (f"```python\n{REWARD}```\nThis rewards x, as", True),
        (f"```python\n{REWARD}```", True),
        (f"<think>So.</think>\n```python\n{REWARD}```\nThis", True),
        (f"1. ```python\n   {REWARD.replace(chr(10), chr(10) + '   ')}\n   ```\n2. This", True),
        (f"```python\n{HELPER}```\n```python\n{CALLER}```\nThis", True),
        (f"```python\n{REWARD}", False),  # the next line may belong to the program
        (f"```python\n{REWARD}``", False),
        (REWARD, False),
        (f"```python\n{REWARD}```\nBetter:\n```python\nimport", False),
        (f"```python\n{REWARD}```\nBetter:\n```python", False),
        (f"```python\n{REWARD.replace('return', 'retrun')}```\nThis", False),
        (f"<think>Perhaps\n```python\n{REWARD}```\nor", False),
        (f"Perhaps\n```python\n{REWARD}```\n</think>\nNo, rather", False),
        ("I would reward x by", False),
        ("", False),
    ],
)
def test_a_reply_is_settled_where_a_cut_takes_nothing_from_its_program(reply: str, settled: bool):
    assert extract.is_settled(reply) is settled


def test_null_bytes_do_no_harm():
    assert extract.program("```python\ndef f():\n    return '\0'\n```") == "def f():\n    return '\0'\n"


LONG = {
    "a fence that is none": "~" * 999_000 + "`",
    "one of backticks": "`" * 999_000 + " x`",
    "quotes": ">" * 999_000 + "`",
    "docstrings that never end": '```\ndef f():\n  """\n```\n' * 40_000,
    "many blocks": "```\ndef f():\n  a\n```\n" * 15_000,
    "prose that never parses": "import a\n" + "it's\n" * 190_000,
    "strings of JSON": json.dumps(["def f():\n a"] * 15_000),
    "docstrings in JSON": json.dumps(['```\ndef f():\n  """\n```\n' * 3_000] * 11),
    "items": "1. - " * 199_000 + "```",
    "blocks that need each other": "".join(
        f"```\ndef f{i + 1}(): f{i}(a{i}, b{i}, c{i}, d{i})\n```\n" for i in range(5_000)
    )
    + "```\ndef reward(): f5000()\n```",
}


@pytest.mark.parametrize("name", LONG)
def test_a_megabyte_of_anything_is_read_in_seconds(name: str) -> None:
    """The time grows linearly with the length. If it grew with the square, the fence would take hours."""
    started = time.thread_time()
    extract.program(LONG[name])
    assert time.thread_time() - started < 60.0


def test_a_megabyte_of_comments_is_told_from_code_in_seconds() -> None:
    started = time.thread_time()
    extract.in_text("#\n \n" * 200_000 + "prose")
    assert time.thread_time() - started < 60.0
