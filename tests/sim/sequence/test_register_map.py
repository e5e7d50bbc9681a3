"""The virtual sequence and the data of its type were each written from the manual: here they are laid side by side, by what they read."""

import math
from collections.abc import Mapping

from app.blocks import sequence as block
from app.plant import types
from app.plant.definitions import EquipmentType
from app.plant.plant_files.languages import LANGUAGES
from app.registers import plc_map
from app.registers.codec import decode
from app.sim.plc import VirtualPlc
from app.sim.sequence import register_map as sequence
from app.sim.sequence.program import VirtualSequence
from tests.sim.coil_car.line import Line, Talker

_sequence, _sequence_problems = types.read_type("sequence", LANGUAGES)


def kind_of() -> EquipmentType:
    assert _sequence_problems == []
    return _sequence.type


def read(plc: VirtualPlc, kind: EquipmentType, key: str) -> float | None:
    register = kind.points[key].register
    assert register
    value = decode(register, plc.read(3, register.address, register.words))
    assert not isinstance(value, str)
    return value


def test_every_code_has_a_name() -> None:
    kind = kind_of()
    assert {int(code) for code in (*sequence.SequenceDeviceEvent, *block.SequenceEvent)} == set(kind.events)
    assert {int(code) for code in sequence.SequenceReason} <= set(kind.reasons)
    assert {command.code for command in kind.commands.values() if command.code} == {
        int(c) for c in sequence.SequenceCommand
    }


def test_every_word_that_is_an_enumeration_has_its_texts() -> None:
    run = kind_of().points
    assert set(run["state"].texts) == {int(word) for word in block.SequenceState}
    assert set(run["first_out_cause"].texts) == {int(word) for word in block.Cause}
    assert set(_sequence.columns["step"]["state"].point.texts) == {int(word) for word in block.StepState}


def test_images_lie_where_the_types_say() -> None:
    plc, of = Line().plc, kind_of().device.plc
    assert of and of.settings
    for image in (*of.images, of.settings):
        assert plc_map.is_whole(plc.read(3, image.address, image.words))
    assert plc.read(3, plc_map.AT_TYPE, 1) == [of.type_code]
    assert of.staging == sequence.STAGING


def test_a_run_that_was_aborted_reads_as_it_was() -> None:
    """Every value of the sequence is put to something that no other has, as far as that goes."""
    line, kind = Line(), kind_of()
    line.sequence.ask(sequence.SequenceCommand.FORCE, 3, 0, plc_map.real(500.0), owner=9)
    line.start()
    line.to_step(5)
    line.run(1)
    line.car.preset({"pressure": 33.0})
    line.run(0.5)
    plc = line.plc
    run, out = plc.block, plc.block.first_out
    assert out and out.bit == 0 and out.step == 5
    expected: Mapping[str, float] = {
        "state": 5,
        "step": 5,
        "steps": 8,
        "stalled": 0,
        "active_steps": 0,
        "recipe_count": 0,
        **{f"recipe_{n}": 0 for n in range(1, 5)},
        "aborting": 0,
        "needs_acknowledge": 1,
        "single_step": 0,
        "automatic": 0,
        "start_possible": 0,
        "forces_active": 1,
        "output": 0,
        "machine_manual": 0,
        "abort_word": 0xFFFF,
        "abort_input": 0xFFFF,
        "abort_forced": 0,
        "abort_forceable": 0,
        "forces": 1,
        "run_time": run.run_time,
        "last_run_time": run.run_time,
        "runs_done": 0,
        "runs_aborted": 1,
        "runs_timed_out": 0,
        "shortest_run": 0,
        "mean_run": 0,
        "longest_run": 0,
        "last_outcome": 5,
        "first_out_cause": block.Cause.PERMISSIVE_LOST,
        "first_out_step": 5,
        "first_out_bit": 0,
        "first_out_at": 5,
        "first_out_time": out.time,
        "first_out_value": 33.0,
        "first_out_together": out.together,
        "first_out_abort_word": 0xFFFF,
        "run_start": plc.runs.start,
        "falls": len(run.falls),
        "device_steps": 8,
        "longest_force": 28800,
        "keep_forces": 0,
        "stall_after": 1.0,
        "output_while_suspended": 0,
    }
    for key, wanted in expected.items():
        found = read(plc, kind, key)
        assert found is not None and math.isclose(found, wanted, rel_tol=1e-6), (key, found, wanted)
    status = {key for key, point in kind.points.items() if point.register and 0x100 <= point.register.address < 0x280}
    assert status == set(expected)


def cells(plc: VirtualSequence, table: str, slot: int) -> dict[str, float]:
    kind = kind_of()
    of = kind.tables[table]
    first = of.address + plc_map.TABLE_HEAD
    row = plc.read(3, first + slot * of.row, of.row)
    found: dict[str, float] = {}
    for key, cell in _sequence.columns[table].items():
        register = cell.point.register
        assert register
        at = register.address - first
        value = decode(register, row[at : at + register.words])
        assert isinstance(value, int | float)
        found[key] = value
    return found


def test_rows_read_as_they_are() -> None:
    line = Line()
    assert (
        line.sequence.ask(sequence.SequenceCommand.FORCE, 3, 0, plc_map.real(500.0), owner=9).state
        == plc_map.AnswerState.DONE
    )
    line.start()
    line.to_step(3)
    line.run(1)
    line.car.preset({"pressure": 33.0})
    line.run(0.1)
    line.car.preset({"pressure": 133.0})
    line.run(0.1)
    plc = line.plc
    force = cells(plc, "force", 0)
    assert (force["id"], force["state"], force["step"], force["bit"]) == (49, 1, 3, 0)
    assert (force["asked"], force["owner"]) == (500, 9) and 480 < force["remaining"] < 500
    fall = cells(plc, "fall", 0)
    assert (fall["id"], fall["state"], fall["step"], fall["bit"]) == (1, 2, 3, 0)
    assert fall["back"] - fall["fell"] == 100_000
    kept = plc.block
    for number in range(1, 9):
        step, times = cells(plc, "step", number - 1), kept.times[number - 1]
        expected: Mapping[str, float] = {
            "id": number,
            "state": kept.step_state(number),
            "word": kept.word(number),
            "input": kept.word(number),
            "forced": kept.forces.bits(number),
            "forceable": 0b1101 if number == 1 else 0b101,
            "minimum": kept.settings.step(number).minimum,
            "maximum": 60.0,
            "elapsed": kept.elapsed(number),
            "loss_aborts": 1,
            "on": kept.output(number),
            "snapshot": kept.first_out.snapshot[number] if kept.first_out else 0,
            "runs": times.runs,
            "least": times.least,
            "mean": times.mean,
            "most": times.most,
            "last": times.last,
            "lost": 1 if number == 3 else step["lost"],
            "passes": 0,  # no loop
        }
        assert set(step) == set(expected)
        for key, wanted in expected.items():
            assert math.isclose(step[key], wanted, rel_tol=1e-6), (number, key, step[key], wanted)


def test_a_talker_reads_what_a_host_reads() -> None:
    line = Line()
    talker = Talker(line.plc)
    line.start()
    assert [event.code for event in talker.events()] == [block.SequenceEvent.STARTED, block.SequenceEvent.STEP_ENTERED]
