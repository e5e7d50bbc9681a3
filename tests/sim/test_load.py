"""The load that never stands quite still, and repeats itself exactly."""

from itertools import pairwise
from random import Random
from statistics import mean, pstdev

from app.sim.load import Load


def run(seed: int, steps: int) -> list[float]:
    load = Load(Random(seed), constant=0.5, disturbance=0.1)
    torques = []
    for _ in range(steps):
        load.step(0.01)
        torques.append(load.torque)
    return torques


def test_same_seed_same_torque_other_seed_another() -> None:
    assert run(3, 5000) == run(3, 5000)
    assert run(3, 5000) != run(4, 5000)


def test_it_varies_about_its_size_around_the_constant_part() -> None:
    torques = run(1, 60000)
    assert 0.45 < mean(torques) < 0.6
    assert 0.02 < pstdev(torques) < 0.15


def test_it_glides_instead_of_jumping() -> None:
    torques = run(1, 60000)
    assert max(abs(b - a) for a, b in pairwise(torques)) < 0.04


def test_bumps_come_and_go() -> None:
    high = [torque > 0.65 for torque in run(1, 60000)]
    assert 0.003 < sum(high) / len(high) < 0.2


def test_without_disturbance_it_is_constant() -> None:
    load = Load(Random(1), constant=0.5)
    for _ in range(500):
        load.step(0.01)
    assert load.torque == 0.5
    assert load.breakaway == 0.625


def test_a_load_never_drives() -> None:
    load = Load(Random(1), constant=0.0, disturbance=0.5)
    for _ in range(20000):
        load.step(0.01)
        assert load.torque >= 0.0
