"""What an instructor changes around the virtual drive acts on it, within its limits."""

import pytest

from app.sim.eura_e800 import training
from tests.sim.eura_e800.stand import FORWARD, command, drive, go, image, refusal

OWN = range(training.REG_LOAD, training.REG_SUPPLY + 1)


@pytest.mark.parametrize("address", OWN)
def test_each_word_is_taken_at_its_edges_and_refused_beyond(address: int) -> None:
    low, high = training.LIMITS[address]
    device = drive()
    for word in (low, high):
        device.write(6, address, [word])
        assert go(device, 0.01).read(3, address, 1) == [word]
    assert refusal(lambda: device.write(6, address, [high + 1])) == 3
    assert device.read(3, address, 1) == [high]


def test_a_device_tells_its_type() -> None:
    assert drive().read(3, 0xE003, 1) == [training.TYPE_CODE]


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("address", "words", "shown", "after"),
    [
        (training.REG_LOAD, (10, 60, 100), 0x02, 2.0),
        (training.REG_LOAD_QUADRATIC, (10, 60, 110), 0x02, 2.0),
        (training.REG_AMBIENT, (0, 25, 60), 0x07, 60.0),
        (training.REG_SUPPLY, (190, 220, 245), 0x04, 1.0),
    ],
)
def test_more_of_it_shows_more(address: int, words: tuple[int, ...], shown: int, after: float) -> None:
    device = command(drive(), FORWARD, 6)
    seen = []
    for word in words:
        device.write(6, address, [word])
        seen.append(image(go(device, after))[shown])
    assert seen == sorted(set(seen)) and device.fault == 0
