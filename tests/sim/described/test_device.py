"""A virtual device by its description: telegrams in, registers out, by numbers that follow from its file."""

from math import exp
from pathlib import Path

import pytest

from app.errors import DeviceException
from app.plant.definitions import Plant
from app.plant.loader import read_plant
from app.registers.codec import decode, encode
from app.registers.pdu import FUNCTIONS
from app.sim.bus import Bus
from app.sim.described.device import DescribedDevice, describe
from app.sim.machines import factory_of
from app.sim.plant import SimPlant, read_simulated
from tests.own_types import MACHINES, METER, SCALE, TYPES, write_own
from tests.virtual import ManualClock


@pytest.fixture
def plant(tmp_path: Path) -> Plant:
    found, problems = read_plant(write_own(tmp_path))
    assert found, problems
    return found


def device(plant: Plant, id: str, seed: int = 1) -> DescribedDevice:
    return describe(plant.equipment[id], seed)


def go(machine: DescribedDevice, seconds: float) -> DescribedDevice:
    for _ in range(round(seconds / machine.dt)):
        machine.step()
    return machine


def told(plant: Plant, machine: DescribedDevice, id: str, key: str) -> object:
    """What a link reads."""
    register = plant.equipment[id].points[key].register
    assert register
    return decode(register, machine.read(FUNCTIONS[register.table], register.address, register.words))


def put(plant: Plant, machine: DescribedDevice, id: str, key: str, value: float, function: int = 16) -> None:
    register = plant.equipment[id].points[key].register
    assert register
    machine.write(function, register.address, encode(register, value))


def refusal(plant: Plant, machine: DescribedDevice, function: int, address: int, *words: int) -> int:
    with pytest.raises(DeviceException) as refused:
        if words:
            machine.write(function, address, words)
        else:
            machine.read(function, address, 1)
    return refused.value.code


def test_it_starts_as_its_file_says_with_the_options_of_the_machine(plant: Plant) -> None:
    machine = device(plant, "e1")
    assert told(plant, machine, "e1", "energy") == 12_000.0  # 1000 x rated_power = 12
    assert told(plant, machine, "e1", "limit") == 50
    assert (told(plant, machine, "e1", "power"), told(plant, machine, "e1", "state")) == (0, 0)


def test_what_is_written_acts_at_the_next_step_and_a_lag_and_an_integral_follow(plant: Plant) -> None:
    machine = device(plant, "e1")
    machine.write(6, 20, [1])
    assert told(plant, machine, "e1", "state") == 0, "not before the border of a step"
    machine.step()
    assert told(plant, machine, "e1", "state") == 1
    go(machine, 2)
    power = told(plant, machine, "e1", "power")
    assert power == pytest.approx(9.6 * (1 - exp(-1)), abs=0.08), "63 % after a time constant, noise of 0.01 around it"
    go(machine, 3600 / 100)
    energy = told(plant, machine, "e1", "energy")
    assert energy == pytest.approx(12_000 + 9.6 * (38 - 2) / 3600, abs=0.002)


@pytest.mark.sweep(8)
def test_a_ramp_goes_at_its_rate_and_a_heartbeat_begins_again(plant: Plant) -> None:
    machine = go(device(plant, "l1"), 2)
    assert told(plant, machine, "l1", "flow") == pytest.approx(1.0, abs=1e-6)
    assert told(plant, machine, "l1", "life") == 2
    assert told(plant, go(machine, 6), "l1", "flow") == 3
    meter = go(device(plant, "e1"), 499)
    assert told(plant, meter, "e1", "life") == 998
    assert told(plant, go(meter, 1), "e1", "life") == 0


def test_a_setpoint_outside_its_limits_and_a_refused_command_change_nothing(plant: Plant) -> None:
    machine = device(plant, "e1")
    put(plant, machine, "e1", "limit", 20)
    assert told(plant, go(machine, 0.01), "e1", "limit") == 20
    for value in (0.5, 101, float("1e30")):
        with pytest.raises(DeviceException) as refused:
            put(plant, machine, "e1", "limit", value)
        assert refused.value.code == 3
    machine.write(6, 0xE010, [7])
    go(machine, 0.02)
    assert refusal(plant, machine, 6, 20, 1) == 4, "the instructor's fault stands"
    machine.write(6, 20, [0])
    assert (told(plant, go(machine, 0.01), "e1", "limit"), told(plant, machine, "e1", "state")) == (20, 0)
    assert refusal(plant, machine, 6, 0xE010, 8) == 3, "a fault that training.toml does not know"


def test_it_takes_the_telegrams_of_its_device_and_no_other(plant: Plant) -> None:
    meter, logger, scale, valve = (device(plant, id) for id in ("e1", "l1", "w2", "v1"))
    assert refusal(plant, meter, 4, 10) == 1 and refusal(plant, logger, 3, 0) == 1
    assert refusal(plant, logger, 6, 0, 1) == 1 and refusal(plant, meter, 6, 10, 1) == 2
    assert refusal(plant, meter, 3, 9) == refusal(plant, meter, 3, 23) == 2
    with pytest.raises(DeviceException) as long:
        meter.read(3, 10, 21)
    assert long.value.code == 3
    assert refusal(plant, scale, 3, 108) == 2, "its hole goes with its base"
    assert scale.read(3, 103, 1) == [0], "what lies between its registers"
    assert refusal(plant, valve, 6, 0, 1) == refusal(plant, valve, 15, 0, 1, 0) == 1
    assert refusal(plant, valve, 5, 2, 1) == 2
    assert refusal(plant, meter, 22, 20, 0, 1) == 1, "its device does not know function 22"
    assert refusal(plant, scale, 22, 102, 0, 1) == refusal(plant, scale, 22, 99, 0, 1) == 2
    assert refusal(plant, scale, 22, 0xE010, 0, 7) == 1, "an instructor's register"


def test_masks_change_their_bits_alone_and_several_in_one_step_add_up(plant: Plant) -> None:
    machine = device(plant, "w2")
    machine.write(22, 105, [0xFF0F, 0x0070])
    machine.write(22, 105, [0xFF7F, 0xFFFF])
    assert told(plant, machine, "w2", "damping") == 2, "not before the border of a step"
    go(machine, 0.01)
    assert (told(plant, machine, "w2", "damping"), told(plant, machine, "w2", "turns")) == (15, 5)
    machine.write(6, 105, [0x0081])
    machine.write(22, 105, [0xFF0F, 0])
    go(machine, 0.01)
    assert machine.read(3, 105, 1) == [1]


def test_bits_of_a_word_are_set_one_by_one_and_a_text_stays(plant: Plant) -> None:
    machine = device(plant, "w1")
    assert told(plant, machine, "w1", "status") == 1 and told(plant, machine, "w1", "name") == "W-1"
    machine.write(6, 4, [1])
    go(machine, 0.01)
    assert told(plant, machine, "w1", "status") == 0x8001
    assert (told(plant, machine, "w1", "stable"), told(plant, machine, "w1", "zeroed")) == (1, 1)
    assert told(plant, machine, "w1", "command") == 0, "its row put it back"
    put(plant, machine, "w1", "load", -7.25)
    go(machine, 0.01)
    assert told(plant, machine, "w1", "status") == 0
    go(machine, 6)
    assert (told(plant, machine, "w1", "weight"), told(plant, machine, "w1", "status")) == (-7.25, 1)


def test_the_same_seed_and_the_same_telegrams_are_the_same_run_however_often_it_is_read(plant: Plant) -> None:
    def run(seed: int, reads: int) -> list[int]:
        machine, words = device(plant, "e1", seed), list[int]()
        for step in range(500):
            if step == 100:
                machine.write(6, 20, [1])
            machine.step()
            for _ in range(reads):
                machine.read(3, 10, 12)
            words += machine.read(3, 10, 12) if step % 50 == 0 else []
        return words

    assert run(1, 0) == run(1, 3)
    assert run(1, 0) != run(2, 0), "another seed, another noise"
    machine, begun = go(device(plant, "e1"), 3), device(plant, "e1")
    machine.write(6, 20, [1])
    machine.write(6, 0xE030, [1])
    assert go(machine, 0.01).read(3, 10, 12) == begun.read(3, 10, 12), "the initial state"
    assert go(machine, 5).read(3, 10, 12) == go(begun, 5).read(3, 10, 12)


def test_noise_makes_no_value_doubtful(tmp_path: Path) -> None:
    folder = write_own(tmp_path)
    points = folder / "equipment" / "meter" / "points.toml"
    points.write_text(METER["points"].replace("low = -1", "low = 0"), "utf-8")
    plant, problems = read_plant(folder)
    assert plant, problems
    machine = device(plant, "e1")
    seen = [float(str(told(plant, go(machine, 0.01), "e1", "power"))) for _ in range(300)]
    assert min(seen) == 0 and 0.005 < max(seen) < 0.05


@pytest.mark.sweep(8)
def test_values_stop_at_the_end_of_their_registers(tmp_path: Path) -> None:
    folder = write_own(tmp_path)
    own = folder / "equipment" / "logger" / "simulation.toml"
    own.write_text(
        "[values.flow]\nintegral = 1e38\n[values.temperature]\nto = 99999\n[values.life]\nevery = 0.02\n", "utf-8"
    )
    plant, problems = read_plant(folder)
    assert plant, problems
    machine = go(device(plant, "l1"), 1400)
    assert told(plant, machine, "l1", "flow") == pytest.approx(3.4e38)
    assert told(plant, machine, "l1", "temperature") == 3276.7
    assert told(plant, machine, "l1", "life") == 70_000 % 65_536


def test_machines_behind_one_unit_are_one_device_on_the_line(plant: Plant) -> None:
    machines = SimPlant(plant, ManualClock())
    (bus,) = machines.buses.values()
    assert isinstance(bus, Bus) and set(bus.devices) == {1, 2, 3, 4, 5}
    unit = bus.devices[3]
    unit.write(6, 104, [1])
    machines.step()
    assert [unit.read(3, at, 1) for at in (2, 102, 202)] == [[1], [0x8001], [1]]
    for call in (lambda: unit.read(3, 50, 1), lambda: unit.write(6, 50, [1])):
        with pytest.raises(DeviceException) as refused:
            call()
        assert refused.value.code == 2
    assert set(machines.merged().devices) == {1, 2, 3, 4, 5}


def test_an_instructor_reaches_each_of_them_by_what_it_knows(tmp_path: Path) -> None:
    other = {
        **SCALE,
        "training": "[faults]\njam = 3\n",
        "texts.en": SCALE["texts.en"] + '[training.fault]\n3 = "Jam"\n',
    }
    other["simulation"] += '[[rules]]\nwhen = "fault == 3"\nset = { zeroed = 1 }\n'
    folder = write_own(
        tmp_path,
        machines=MACHINES.replace(
            'type = "scale"\nlink = "line"\nunit = 3\nbase = 100',
            'type = "scale_2"\nlink = "line"\nunit = 3\nbase = 100',
        ),
    )
    (folder / "equipment" / "scale_2").mkdir()
    for file, text in other.items():
        (folder / "equipment" / "scale_2" / f"{file}.toml").write_text(text, "utf-8")
    plant, problems = read_plant(folder)
    assert plant, problems
    machines = SimPlant(plant, ManualClock())
    unit = machines.buses["line"].devices[3]
    unit.write(16, 0xE010, [3])
    machines.step()
    assert unit.read(3, 0xE010, 1) == [3]
    assert [unit.read(3, at, 1)[0] >> 15 for at in (2, 102, 202)] == [0, 1, 0]
    with pytest.raises(DeviceException) as refused:
        unit.write(16, 0xE010, [4])
    assert refused.value.code == 3
    unit.write(16, 0xE011, [7, 0, 2, 1])
    machines.step()
    bus = machines.buses["line"]
    assert bus.answer(3, bytes((3, 0, 0, 0, 1))).pdu == bytes((0x83, 2))
    assert unit.read(3, 0xE011, 4) == [0, 0, 2, 0], "it hit one telegram and is over"


def test_a_base_does_not_move_registers_to_where_an_instructor_writes(tmp_path: Path) -> None:
    folder = write_own(tmp_path, machines=MACHINES.replace("base = 200", "base = 57340"))
    (problem,) = read_simulated(folder)[1]
    assert problem.key == "equipment.w3.simulation" and "base = 57340: its register 0xE000 lies among" in problem.value


def test_a_start_that_the_options_of_a_machine_make_too_large_is_told_with_the_machine(tmp_path: Path) -> None:
    folder = write_own(tmp_path)
    own = folder / "equipment" / "meter" / "simulation.toml"
    own.write_text(METER["simulation"].replace('"1000 * rated_power"', '"1e18 * rated_power"'), "utf-8")
    (problem,) = read_simulated(folder)[1]
    assert problem.key == "equipment.e1.simulation" and "energy = 1e18 * rated_power = 1.2e+19" in problem.value


def test_it_goes_on_over_a_reload_unless_its_description_is_another_one(plant: Plant, tmp_path: Path) -> None:
    machines = SimPlant(plant, ManualClock())
    before = dict(machines.devices)
    own = tmp_path / "equipment" / "logger" / "simulation.toml"
    own.write_text(own.read_text("utf-8").replace("rate = 0.5", "rate = 1"), "utf-8")
    new, problems = read_plant(tmp_path)
    assert new, problems
    _, devices, _ = machines.renewed(new, ["line"], {})
    assert devices["e1"] is before["e1"] and devices["w3"] is before["w3"] and devices["l1"] is not before["l1"]


def test_who_describes_nothing_has_none(tmp_path: Path) -> None:
    folder = write_own(tmp_path, machines=MACHINES.replace("base = 100\n", "").replace("base = 200\n", ""))
    text = (folder / "plant.toml").read_text("utf-8")
    for unit in (13, 23):  # each for itself
        head, _, rest = text.rpartition("unit = 3\n")
        text = f"{head}unit = {unit}\n{rest}"
    (folder / "plant.toml").write_text(text, "utf-8")
    for name in TYPES:
        (folder / "equipment" / name / "simulation.toml").unlink()
    plant, problems = read_plant(folder)
    assert plant, problems
    assert [factory_of(item) for item in plant.equipment.values()] == [None] * 7
    found = read_simulated(folder)[1]
    assert any(
        problem.key == "equipment.v1.link" and "equipment/valve/simulation.toml would describe one" in problem.expected
        for problem in found
    )
