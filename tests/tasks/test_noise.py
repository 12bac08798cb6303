import torch

from openeureka.tasks import noise
from openeureka.tasks.noise import WorldNoise
from openeureka.tasks.registry import make

CPU = torch.device("cpu")


def every(n: int) -> torch.Tensor:
    return torch.arange(n)


def test_lanes_of_equal_seed_draw_equal_numbers_and_others_do_not():
    draws = WorldNoise([3, 3, 4], worlds=5, device=CPU).uniform(every(15), 2)
    assert torch.equal(draws[0:5], draws[5:10])
    assert not torch.isclose(draws[0:5], draws[10:15]).any()


def test_a_world_does_not_notice_the_draws_of_another():
    alone, beside = (WorldNoise([0], worlds=2, device=CPU) for _ in range(2))
    for _ in range(7):
        beside.uniform(torch.tensor([1]), 3)
    first = torch.tensor([0])
    assert torch.equal(alone.uniform(first, 3), beside.uniform(first, 3))


def test_the_generator_is_splitmix64():
    # The first numbers of the published generator for seed 1234567. Other constants would look as random, but no
    # measurement would repeat.
    expected = [6457827717110365317, 3203168211198807973, 9817491932198370423, 4593380528125082431]
    states = 1234567 + torch.arange(1, 5) * noise._GOLDEN
    assert [number % 2**64 for number in noise._mix(states).tolist()] == expected


def test_the_numbers_of_a_seed_stay_what_they_are():
    # Seed 7, computed with Python's integers; numbers are 24 bits.
    stream = WorldNoise([7], worlds=2, device=CPU)
    first, second = ((stream.uniform(every(2), 2) * 2**24).long().tolist() for _ in range(2))
    assert first == [[406651, 5232921], [2881272, 3464250]]
    assert second == [[11188433, 16696346], [12405742, 15862478]]


def test_numbers_are_uniform_and_uncorrelated():
    stream = WorldNoise([0], worlds=20_000, device=CPU)
    a, b = stream.uniform(every(20_000), 2, -1.0, 3.0), stream.uniform(every(20_000), 2, -1.0, 3.0)
    assert a.min() >= -1.0 and a.max() < 3.0
    # Uniform on [-1, 3): mean 1, variance 16/12; standard error of the mean 0.008, of a correlation 0.007.
    assert torch.allclose(a.mean(0), torch.ones(2), atol=0.04)
    assert torch.allclose(a.var(0), torch.full((2,), 16 / 12), atol=0.04)
    pairs = torch.corrcoef(torch.cat((a, b), dim=1).T) - torch.eye(4)
    assert pairs.abs().max() < 0.04


def test_a_staggered_start_spreads_time_outs_and_does_not_count_the_cut_episodes():
    env = make("quadcopter", worlds=64, threads=1)
    length = env.task.episode_length
    env.reset(stagger=True)
    start = env.task.progress.clone()
    assert int(start.min()) >= 0 and int(start.max()) < length - 1 and len(start.unique()) > 32
    ended, done = torch.zeros(64, dtype=torch.int64), torch.zeros(64, dtype=torch.int64)
    for _ in range(length - 1):
        step = env.step(torch.zeros(64, 12))
        ended, done = ended + step.ended, done + step.done
        assert torch.equal(step.score.weight, torch.ones(64))  # F over steps counts cut episodes: their states are real
    # Every world that did not start at 0 had one cut episode, and nothing else may be left out.
    assert torch.equal(done - ended, ((start > 0) & (done > 0)).long())
