"""Training registers of the virtual sequence."""

import pytest

from app.blocks.sequence import ALL
from app.errors import DeviceException
from app.sim import training
from app.sim.sequence import training as own
from tests.sim.sequence.stand import drop, step_row, taught, word


def test_the_words_of_all_200_steps_are_taught_by_registers() -> None:
    plc, talker = taught(*[(0.01, 5.0)] * 200)
    for place in (0, 1, 14, 15, 100, 200):
        assert plc.read(3, own.REG_WORDS + place, 1) == [ALL]
        talker.train(own.REG_WORDS + place, ALL & ~(1 << place % 16))
    plc.step()
    assert word(plc, 6) == ALL & ~1 and step_row(plc, 200)[5] == ALL & ~(1 << 8) and step_row(plc, 99)[5] == ALL
    assert plc.read(3, own.REG_PERMISSIVES, 15) == plc.read(3, own.REG_WORDS, 15), "the first also stand there"
    drop(talker, 2, 0b10)
    plc.preset({"word_3": 5})
    plc.step()
    assert plc.read(3, own.REG_WORDS + 2, 2) == [ALL & ~0b10, 5] and step_row(plc, 2)[5] == ALL & ~0b10
    talker.train(training.REG_RESET, 1)
    plc.step()
    assert plc.read(3, own.REG_WORDS + 100, 101) == [ALL] * 101 and step_row(plc, 200)[5] == ALL


def test_a_word_that_no_step_has_is_refused() -> None:
    plc, _ = taught()
    assert plc.read(3, own.REG_WORDS, 4) == [ALL] * 4
    for ask in (
        lambda: plc.read(3, own.REG_WORDS, 5),
        lambda: plc.write(6, own.REG_WORDS + 4, [0]),
        lambda: plc.write(16, own.REG_WORDS + 3, [0, 0]),
    ):
        with pytest.raises(DeviceException) as error:
            ask()
        assert error.value.code == 2
