import pytest

from openeureka.cli.check import check
from openeureka.errors import RewardFileError

GOOD = """
def compute_reward(pole_angle):
    upright = torch.exp(-10.0 * pole_angle**2)
    return upright, {"upright": upright}
"""
BAD = """
def compute_reward(pole_angel):
    return pole_angel, {}
"""


def test_a_good_reward_is_accepted_with_its_components(tmp_path, capsys):
    (tmp_path / "good.py").write_text(GOOD)
    assert check(["env=cartpole", f"{tmp_path}/good.py"]) == 0
    text = capsys.readouterr().out
    assert "good.py: accepted" in text and "components: upright" in text


def test_a_refused_reward_is_explained_with_line_rule_and_fix(tmp_path, capsys):
    (tmp_path / "bad.py").write_text(BAD)
    assert check(["env=cartpole", f"{tmp_path}/bad.py"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].endswith("bad.py: refused")
    assert lines[1].startswith("line 2: `pole_angel` is not a state variable")
    assert "did you mean `pole_angle`?" in lines[1]


def test_a_missing_or_binary_file_is_named(tmp_path):
    (tmp_path / "binary.py").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(RewardFileError, match=r"Cannot read the reward file .*absent\.py: No such file"):
        check(["env=cartpole", f"{tmp_path}/absent.py"])
    with pytest.raises(RewardFileError, match=r"binary\.py is not a text file"):
        check(["env=cartpole", f"{tmp_path}/binary.py"])


def test_files_that_lie_around_are_not_imported(tmp_path, monkeypatch, capsys):
    (tmp_path / "good.py").write_text(GOOD)
    (tmp_path / "tempfile.py").write_text(f"open({str(tmp_path / 'mark')!r}, 'w')\n")  # of somebody who means harm
    (tmp_path / "glob.py").write_text("raise RuntimeError('my own notes on globs')\n")  # of somebody who does not
    monkeypatch.chdir(tmp_path)
    assert check(["env=cartpole", "good.py"]) == 0
    assert not (tmp_path / "mark").exists()
