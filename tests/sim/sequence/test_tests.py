"""Given, when, then of a definition, run on fresh virtual devices."""

from collections.abc import Mapping, Sequence
from typing import Any

import pytest

from app.clock import ManualClock
from app.errors import ConfigurationError
from app.plant.sequence_definition import SequenceTest
from app.sim.plant import SimPlant
from app.sim.sequence.program import VirtualSequence
from app.sim.sequence.tests import run_tests
from app.sim.type_tests import TestResult
from tests.sim.coil_car.line import TRANSPORT, plant, teaching

START: Mapping[str, object] = {"at": 0.0, "command": "start"}
COIL = {"coil": 1.0}


def results(*tests: SequenceTest, **options: Any) -> list[TestResult]:
    return run_tests(plant(TRANSPORT, *tests, **options), "seq1")


def result(
    given: Mapping[str, float], when: Sequence[Mapping[str, object]], *then: Mapping[str, object], **options: Any
) -> TestResult:
    (one,) = results(SequenceTest("it", given, tuple(when), then), **options)
    return one


def taught(when: Sequence[Mapping[str, object]], *then: Mapping[str, object], **given: float) -> TestResult:
    test = SequenceTest("it", given, tuple(when), then)
    (one,) = run_tests(plant(teaching((1.0, 5.0), (1.0, 5.0)), test, machine=False), "seq1")
    return one


def machine_of(device: VirtualSequence) -> object:
    return device.machine


@pytest.mark.sweep(8)
def test_a_transport_passes_in_the_time_of_its_machine() -> None:
    one = result(
        COIL,
        [START],
        {"within": 20.0, "step": "lift"},
        {"within": 90.0, "state": "done"},
        {"at": 12.0, "expect": "horizontal < 1010 and vertical > 100"},
        {"within": 90.0, "expect": "saddle_1 == 1"},
        {"never": "collision == 1"},
        {"never": "coil_on_car == 1 and mandrel == 2 and zone_mandrel == 1"},
    )
    assert one.ok and one.happened.endswith("done") and 40 < one.simulated < 90


def test_a_fault_and_presets_act_at_their_time() -> None:
    one = result(
        COIL, [START, {"at": 9.0, "fault": 31}], {"first_out": "pressure_ok"}, {"within": 15.0, "state": "aborted"}
    )
    assert one.ok
    one = result(
        COIL,
        [START, {"at": 9.0, "set": {"pressure": 20.0}}],
        {"at": 8.9, "state": "running"},
        {"at": 9.5, "state": "aborted"},
        {"first_out": "pressure_ok", "within": 9.5},
    )
    assert one.ok


def test_commands_of_the_sequence_are_telegrams() -> None:
    one = result(
        COIL,
        [START, {"at": 3.0, "command": "suspend"}, {"at": 9.0, "command": "resume"}, {"at": 12.0, "command": "abort"}],
        {"at": 4.0, "state": "suspended"},
        {"at": 8.0, "expect": "horizontal_speed == 0 and horizontal > 1000"},
        {"at": 10.0, "state": "running"},
        {"at": 13.0, "state": "aborted"},
    )
    assert one.ok, one.happened


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("then", "said"),
    [
        ({"within": 5.0, "state": "done"}, "state done within 5 s: it was not; at 5.00 s running, in step 2 drive_in"),
        ({"at": 1.0, "state": "idle"}, "state idle at 1 s: it was not"),
        ({"within": 3.0, "step": "lift"}, "step lift within 3 s: it was not"),
        ({"at": 2.0, "expect": "vertical > 100"}, '"vertical > 100" at 2 s: it was not'),
        ({"never": "moving == 1"}, 'never "moving == 1": it was at'),
        ({"first_out": "pressure_ok"}, "first-out pressure_ok: it was not"),
        ({"first_out": "coil_ready", "within": 4.0}, "first-out coil_ready within 4 s: it was not"),
    ],
)
def test_what_does_not_happen_fails_with_what_did(then: Mapping[str, object], said: str) -> None:
    one = result(COIL, [START], then)
    assert not one.ok and one.happened.startswith(said)


def test_a_refused_command_is_told_with_what_failed() -> None:
    one = result({"coil": 0.0, "automatic_winding": 0.0}, [START], {"within": 5.0, "state": "running"})
    assert not one.ok
    assert one.happened == (
        "state running within 5 s: it was not; start at 0 s refused: missing (18); at 5.00 s idle, missing coil_ready"
    )
    assert result({"coil": 0.0, "automatic_winding": 0.0}, [START], {"at": 5.0, "state": "idle"}).ok


def test_what_cannot_be_done_fails() -> None:
    assert "touches the coil on mandrel" in result({**COIL, "horizontal": 1000.0, "vertical": 900.0}, []).happened
    assert "machine fault 77" in result(COIL, [{"at": 1.0, "fault": 77}], {"at": 2.0, "state": "idle"}).happened
    late = result(COIL, [{"at": 1.0, "set": {"guard_1": 7.0}}], {"at": 2.0, "state": "idle"})
    assert not late.ok and late.happened.startswith("when at 1 s: preset guard_1")


def test_the_mode_of_the_machine_is_automatic_unless_given() -> None:
    assert result({**COIL, "mode": 2.0}, [START], {"at": 1.0, "state": "idle"}).ok
    assert result(COIL, [START], {"at": 1.0, "state": "running"}).ok


@pytest.mark.sweep(8)
def test_each_test_has_a_fresh_machine_and_the_same_result_every_time() -> None:
    tests = (
        SequenceTest("one", COIL, (START,), ({"within": 90.0, "state": "done"},)),
        SequenceTest("two", {}, (), ({"at": 1.0, "expect": "saddle_1 == 0 and coils_done == 0"},)),
        SequenceTest("three", {"saddle_1": 1.0, **COIL}, (START,), ({"within": 90.0, "expect": "saddle_2 == 1"},)),
    )
    first, second = results(*tests), results(*tests)
    assert [one.ok for one in first] == [True] * 3
    assert [(one.name, one.happened, one.simulated) for one in first] == [
        (one.name, one.happened, one.simulated) for one in second
    ]
    assert [one.name for one in results(*reversed(tests))] == ["three", "two", "one"]


def test_without_a_machine_the_words_are_the_presets_and_the_sentences_look_at_the_sequence() -> None:
    assert taught([START], {"within": 3.0, "state": "done"}).ok
    one = taught(
        [START, {"at": 0.5, "set": {"word_2": 0xFFF7}}, {"at": 3.0, "set": {"word_2": 65535.0}}],
        {"within": 2.9, "first_out": "bit_3"},
        {"at": 2.9, "step": "s1"},
        {"at": 3.1, "step": "s2"},
    )
    assert one.ok, one.happened
    frozen = taught(
        [START, {"at": 0.5, "fault": 1}, {"at": 0.6, "set": {"word_0": 0.0}}], {"within": 3.0, "state": "done"}
    )
    assert frozen.ok
    assert not taught([START], {"within": 3.0, "state": "done"}, word_2=0.0).ok


def test_only_an_equipment_with_a_sequence_has_tests() -> None:
    for id in ("cc1", "nobody"):
        with pytest.raises(ConfigurationError, match=id):
            run_tests(plant(TRANSPORT), id)
    assert run_tests(plant(TRANSPORT), "seq1") == []


def test_a_plant_couples_its_sequence_with_its_machine() -> None:
    of = plant(TRANSPORT, simulation={"coil": 1, "start": "automatic"})
    sim = SimPlant(of, ManualClock())
    sequence = sim.devices["seq1"]
    assert isinstance(sequence, VirtualSequence) and machine_of(sequence) is sim.devices["cc1"]
    assert sim.renewed(of, ["coil"], {})[1] == sim.devices
    equipment, devices, buses = sim.renewed(plant(TRANSPORT, simulation={"coil": 0}), ["coil"], {})
    assert devices["cc1"] is not sim.devices["cc1"]
    sim.take(equipment, devices, buses)
    again = sim.devices["seq1"]
    assert again is not sequence, "a sequence does not go on with a machine that begins anew"
    assert isinstance(again, VirtualSequence) and machine_of(again) is devices["cc1"]
    longer = plant(teaching((1.0, 2.0)), machine=False)
    _, devices, _ = sim.renewed(longer, ["coil"], {})
    assert devices["seq1"] is not again


def test_a_plant_says_what_its_virtual_devices_do_not_take() -> None:
    for options, said in (
        ({"simulation": {"start": "fast"}}, "start"),
        ({"simulation": {"speed": 1}}, "speed"),
        ({"lift": 100.0}, "lift"),
        ({"simulation": 3}, "simulation"),
    ):
        with pytest.raises(ConfigurationError, match=said):
            SimPlant(plant(TRANSPORT, **options), ManualClock())
