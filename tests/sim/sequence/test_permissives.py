"""The permissive words of the virtual sequence: sentences over its machine, or words that are taught."""

from dataclasses import replace

import pytest

from app.blocks.sequence import ALL, SequenceState
from app.errors import ConfigurationError
from app.plant.sequence_definition import SequenceDefinition
from app.sim.sequence.program import VirtualSequence
from app.sim.sequence.register_map import (
    SequenceCommand,
)
from tests.sim.coil_car.line import TRANSPORT, Line, bit, step, teaching
from tests.sim.sequence.stand import DONE, step_row, word


def test_frozen_inputs_are_a_fault_of_the_instructor() -> None:
    line = Line()
    line.start()
    line.to_step(2)
    line.sequence.fault(1)
    line.tick()
    line.car.preset({"pressure": 10})
    line.run(1)
    assert word(line.plc, 1) == SequenceState.RUNNING
    line.sequence.fault(0)
    line.run(0.1)
    assert word(line.plc, 1) == SequenceState.ABORTED


@pytest.mark.parametrize(
    ("definition", "said"),
    [
        (replace(TRANSPORT, steps=(step("a", bit(5, "x", "speed > 1")),)), "speed"),
        (replace(TRANSPORT, steps=(step("a", action="fly"),)), "fly"),
        (replace(TRANSPORT, steps=(step("a", bit(5, "x", "")),)), "x has no sentence"),
        (replace(TRANSPORT, steps=(step("a", bit(5, "x", "mode == 1", "speed")),)), "value speed"),
    ],
)
def test_a_definition_that_does_not_fit_the_machine_says_why(definition: SequenceDefinition, said: str) -> None:
    with pytest.raises(ConfigurationError, match=said):
        Line(definition)


def test_a_sentence_that_cannot_be_decided_is_missing() -> None:
    definition = replace(TRANSPORT, steps=(step("a", bit(5, "near", "contact_height < 900")),))
    line = Line(definition, coil=False, settings={"automatic_winding": 0.0})
    assert line.sequence.ask(SequenceCommand.START).detail == 16 + 5
    line.car.preset({"coil": 1})
    assert line.sequence.ask(SequenceCommand.START).state == DONE


def test_without_a_machine_words_beyond_the_training_registers_are_presets() -> None:
    plc = VirtualSequence(teaching(*((0.5, 5.0),) * 20))
    plc.preset({"word_20": 0xFFFE, "word_0": 0xFFFF})
    plc.step()
    assert step_row(plc, 20)[5] == 0xFFFE and step_row(plc, 19)[5] == ALL
    for values in ({"word_21": 1.0}, {"word_1": 70000.0}, {"pressure": 1.0}, {"word_1": 0.5}):
        with pytest.raises(ValueError, match="expected"):
            plc.preset(values)
