from openeureka.cli.tasks import context, envs
from openeureka.tasks import registry


def test_envs_lists_every_task(capsys):
    envs()
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines()[1:]]
    assert listed == registry.names()


def test_context_shows_the_state_and_hides_the_fitness(capsys):
    context(["env=cartpole"])
    text = capsys.readouterr().out
    assert "pole_angle     Tensor (N)     pole angle from upright [rad]" in text
    assert "def compute_state" in text and "fitness" not in text
