"""A simulated plant against the clock, its buses, and what it says when it cannot be built or served."""

import asyncio
import os
import shutil
from functools import partial
from pathlib import Path

import pytest

from app.clock import ManualClock
from app.errors import ConfigurationError
from app.plant.definitions import Device, Equipment, EquipmentType, Link, Plant
from app.plant.said import in_words
from app.plant.texts import Texts
from app.registers import plc_map
from app.registers.pdu import read_request
from app.sim.machines import VIRTUAL_DEVICES
from app.sim.plant import SimPlant, read_simulated
from app.sim.server import Openings, simulate
from app.sim.watchdog import Watchdog
from tests.demo_plant import DEMO
from tests.sim.fake_device import FakeDevice
from tests.sim.fake_plc import FakePlc
from tests.virtual import loop_clock

FAKE = EquipmentType("fake", Path("fake"), "fake", Device(), {}, {}, (), (), {}, (), {})


def plant(*places: tuple[str, str, int], **baud: int) -> Plant:
    """A plant with an equipment per (id, link, unit)."""
    equipment = {id: Equipment(id, FAKE, link, unit, {}, "", {}, ()) for id, link, unit in places}
    links = {link: Link(link, "memory", baud=baud.get(link, 9600)) for _, link, _ in places}
    return Plant(Path("nowhere"), {}, "UTC", ["en"], {}, links, equipment, {"fake": FAKE})


def build(equipment: Equipment, seed: int) -> FakeDevice:
    return FakeDevice(seed=seed)


TWO_LINKS = plant(("m1", "hall", 1), ("m2", "hall", 2), ("m3", "yard", 1))


def simulated(of: Plant = TWO_LINKS, clock: ManualClock | None = None, **options: object) -> SimPlant:
    return SimPlant(of, clock or ManualClock(), factories={"fake": build}, **options)  # type: ignore[arg-type]


def test_every_equipment_gets_a_device_on_the_bus_of_its_link() -> None:
    sim = simulated()
    assert list(sim.devices) == ["m1", "m2", "m3"]
    assert {name: sorted(bus.devices) for name, bus in sim.buses.items()} == {"hall": [1, 2], "yard": [1]}
    assert sim.buses["yard"].devices[1] is sim.devices["m3"]
    assert list(simulated(links=["yard"]).devices) == ["m3"]


def test_a_seed_belongs_to_a_machine_and_not_to_its_place() -> None:
    def seeds(sim: SimPlant) -> dict[str, int]:
        return {id: device.seed for id, device in sim.devices.items() if isinstance(device, FakeDevice)}

    assert len(set(seeds(simulated()).values())) == 3
    assert seeds(simulated()) == seeds(simulated())
    assert seeds(simulated(links=["yard"]))["m3"] == seeds(simulated())["m3"]
    assert seeds(simulated(seed=2)) != seeds(simulated())


def test_what_a_virtual_device_does_not_take_is_a_problem_of_the_plant_file(tmp_path: Path) -> None:
    demo = Path("plants/demo/plant.toml").read_text("utf-8")
    shutil.copytree("plants/demo", tmp_path, dirs_exist_ok=True)
    (tmp_path / "plant.toml").write_text(demo.replace("F113 = 40.0", "F113 = 4000"), "utf-8")
    broken, (problem,) = read_simulated(tmp_path)
    assert broken is None
    assert (problem.file, problem.key) == ("plant.toml", "equipment.m1.simulation")
    assert problem.value == "parameter F113 takes 0 to 650 Hz, not 4000.0"
    german = partial(Texts.read().text, "de")
    assert in_words(german, problem.value) == "Parameter F113: zulässig ist 0 bis 650 Hz, nicht 4000.0"
    assert in_words(german, problem.expected) == "was sein virtuelles Gerät annimmt"
    real = demo.replace("F113 = 40.0", "F113 = 4000").replace('"memory"', '"tcp"\nhost = "192.0.2.1"')
    (tmp_path / "plant.toml").write_text(real, "utf-8")
    assert read_simulated(tmp_path)[1] == []


def test_a_type_without_a_virtual_device_is_named() -> None:
    with pytest.raises(ConfigurationError, match="m1: type fake has no virtual device, expected one of: other"):
        SimPlant(TWO_LINKS, ManualClock(), factories={"other": build})
    with pytest.raises(ConfigurationError, match="link cellar: expected one of hall, yard"):
        simulated(links=["cellar"])


def test_a_simulated_link_of_a_machine_that_nothing_simulates_is_the_mistake(tmp_path: Path) -> None:
    demo = (DEMO / "plant.toml").read_text("utf-8").partition("[equipment.c1]")[0]
    (tmp_path / "plant.toml").write_text(demo, "utf-8")
    broken, problems = read_simulated(tmp_path, {"other": build})
    assert broken is None
    assert {(one.key, one.value, one.expected) for one in problems} >= {
        (
            "equipment.m1.link",
            '"hall"',
            "a link that is not memory: type eura_e800 has no virtual device; "
            "equipment/eura_e800/simulation.toml would describe one",
        )
    }
    assert not [one for one in problems if one.key.endswith(".simulation")]


def test_units_that_collide_are_all_named() -> None:
    with pytest.raises(
        ConfigurationError, match="unit 1 is m1 on link hall and m3 on link yard: expected different units"
    ):
        simulated().merged()
    assert sorted(simulated(links=["hall"]).merged().devices) == [1, 2]


def test_the_plant_keeps_step_with_the_clock() -> None:
    clock = ManualClock()
    sim = simulated(clock=clock)
    assert sim.catch_up() == 0
    for _ in range(100):
        clock.advance(0.0137)
        sim.catch_up()
    clock.advance(0.005)
    sim.catch_up()
    assert sim.steps == 137
    assert {device.steps for device in sim.devices.values() if isinstance(device, FakeDevice)} == {137}
    assert (sim.overruns, sim.lost) == (0, 0.0)


def test_late_it_catches_up_twenty_steps_and_gives_up_the_rest() -> None:
    clock = ManualClock()
    sim = simulated(clock=clock)
    clock.advance(0.205)
    assert sim.catch_up() == 20
    assert sim.overruns == 0
    clock.advance(1.0)
    assert sim.catch_up() == 20
    assert sim.overruns == 1
    assert sim.lost == pytest.approx(0.8)
    assert sim.lag == pytest.approx(0.995)
    clock.advance(0.01)
    assert sim.catch_up() == 1, "after giving up it is on time again"
    assert sim.lag < 0.01


def test_steps_that_are_owed_are_done_in_turns_that_leave_time_for_others() -> None:
    clock = ManualClock()

    class Heavy(FakeDevice):
        def step(self) -> None:
            FakeDevice.step(self)
            clock.advance(0.006)

    sim = SimPlant(plant(("m1", "hall", 1)), clock, factories={"fake": lambda equipment, seed: Heavy()})
    clock.advance(0.1)
    assert [sim.catch_up(), sim.catch_up()] == [4, 4]
    assert (sim.steps, sim.overruns, sim.lost) == (8, 0, 0.0), "the rest is still owed, not given up"


async def test_a_plant_that_is_too_large_runs_slower_and_nobody_waits_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.sim.plant.PACE_WINDOW", 0.5)
    clock = loop_clock()
    assert isinstance(clock, ManualClock)

    class Heavy(FakeDevice):
        def step(self) -> None:
            FakeDevice.step(self)
            clock.advance(0.002)

    many = plant(*((f"m{n}", "hall", n) for n in range(1, 21)))  # 40 ms for each 10 ms
    sim = SimPlant(many, clock, factories={"fake": lambda equipment, seed: Heavy()})
    running = asyncio.create_task(sim.run())
    loop, turns = asyncio.get_running_loop(), list[float]()
    end = loop.time() + 2.0
    while loop.time() < end:
        began = clock.monotonic()
        await asyncio.sleep(0.001)
        turns.append(clock.monotonic() - began)
    running.cancel()
    taken = sum(turn for turn in turns if turn > 0.03)
    assert taken < 0.9 * sum(turns), "the others have their part of the time"
    assert max(turns) < 0.2, "and never wait for twenty steps"
    assert sim.pace < 0.6 and sim.lost > 0.5


def test_the_computing_time_of_a_step_is_told() -> None:
    clock = ManualClock()

    class Heavy(FakeDevice):
        def step(self) -> None:
            FakeDevice.step(self)
            clock.advance(0.004 if self.steps == 2 else 0.001)

    sim = SimPlant(plant(("m1", "hall", 1)), clock, factories={"fake": lambda equipment, seed: Heavy()})
    for _ in range(3):
        sim.step()
    assert sim.step_last == pytest.approx(0.001)
    assert sim.step_max == pytest.approx(0.004)


async def test_running_it_moves_at_the_pace_of_the_wall() -> None:
    sim = SimPlant(TWO_LINKS, loop_clock(), factories={"fake": build})
    await asyncio.sleep(0.2)
    task = asyncio.create_task(sim.run())
    await asyncio.sleep(0.5)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert 40 <= sim.steps <= 52, "what lay before the start is not caught up"


@pytest.mark.parametrize(
    ("openings", "expected"),
    [
        (Openings(), "nothing to serve on: expected --tcp HOST:PORT, --serial PATH or --pty"),
        (Openings(pty=True, link="cellar"), "link cellar: expected one of hall, yard"),
        (Openings(pty=True), "unit 1 is m1 on link hall and m3 on link yard"),
        (Openings(serial="/dev/ttyNone", link="hall"), "serial /dev/ttyNone: expected a serial device at 9600 baud"),
    ],
)
async def test_what_cannot_be_served_is_told(
    openings: Openings, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(VIRTUAL_DEVICES, "fake", build)
    with pytest.raises(ConfigurationError, match=expected):
        await simulate(TWO_LINKS, loop_clock(), openings, lambda line: None)


async def test_links_of_different_speed_need_a_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(VIRTUAL_DEVICES, "fake", build)
    mixed = plant(("m1", "hall", 1), ("m2", "yard", 2), yard=19200)
    with pytest.raises(ConfigurationError, match=r"baud differs \(hall 9600, yard 19200\)"):
        await simulate(mixed, loop_clock(), Openings(pty=True), lambda line: None)


@pytest.mark.real_time
async def test_all_openings_serve_the_same_devices_until_a_signal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(VIRTUAL_DEVICES, "fake", build)
    said: asyncio.Queue[str] = asyncio.Queue()
    served = asyncio.create_task(
        simulate(
            TWO_LINKS, loop_clock(), Openings(("127.0.0.1", 0), pty=True, link="hall", baud=115200), said.put_nowait
        )
    )
    async with asyncio.timeout(2):
        lines = [await said.get() for _ in range(5)]
    assert lines[:2] == ["unit 1 m1 fake", "unit 2 m2 fake"]
    assert lines[2].startswith("tcp 127.0.0.1:")
    assert lines[3].startswith("rtu /dev/pts/") and lines[3].endswith(" 115200 baud parity none")
    assert lines[4] == "ready"
    reader, writer = await asyncio.open_connection("127.0.0.1", int(lines[2].rpartition(":")[2]))
    writer.write(b"\0\1\0\0\0\6\2" + read_request(0x1000, 1))
    assert await reader.readexactly(11) == b"\0\1\0\0\0\5\2\3\2\0\x64"
    writer.close()
    os.kill(os.getpid(), 15)
    async with asyncio.timeout(2):
        await served


@pytest.mark.parametrize("speed", [1, 2, 5, 10])
def test_a_faster_plant_does_its_steps_so_much_faster(speed: int) -> None:
    clock = ManualClock()
    sim = simulated(clock=clock)
    sim.set_speed(speed)
    for _ in range(600):
        clock.advance(0.01)
        sim.catch_up()
    assert sim.steps == pytest.approx(600 * speed, abs=1)
    assert (sim.achieved, sim.lost) == (speed, 0.0)


def test_a_paused_plant_stands_still_and_makes_up_for_nothing() -> None:
    clock = ManualClock()
    sim = simulated(clock=clock)
    sim.set_speed(0)
    assert all(bus.paused for bus in sim.buses.values())
    for _ in range(500):
        clock.advance(0.02)
        assert sim.catch_up() == 0
    sim.set_speed(1)
    assert not any(bus.paused for bus in sim.buses.values())
    clock.advance(0.0101)
    assert (sim.catch_up(), sim.steps, sim.lost) == (1, 1, 0.0)


def test_what_a_computer_does_not_follow_is_told() -> None:
    clock = ManualClock()
    sim = simulated(clock=clock)
    sim.set_speed(10)
    for _ in range(20):
        clock.advance(0.4)  # owes 400 steps each time and makes up for 200
        sim.catch_up()
    assert sim.achieved == pytest.approx(5.0, abs=0.5)


@pytest.mark.parametrize("speed", [-1, 3, 11])
def test_another_speed_is_refused(speed: int) -> None:
    with pytest.raises(ConfigurationError, match=f"speed {speed}: expected one of 0, 1, 2, 5, 10"):
        simulated().set_speed(speed)


@pytest.mark.parametrize("speed", [1, 10])
def test_the_clock_of_a_plc_goes_on_with_real_time(speed: int) -> None:
    clock, device = ManualClock(), FakePlc()
    sim = SimPlant(TWO_LINKS, clock, factories={"fake": lambda item, seed: device})
    before = device.time

    def run(seconds: float) -> None:
        for _ in range(round(seconds / 0.01)):
            clock.advance(0.01)
            sim.catch_up()

    sim.set_speed(speed)
    run(3.0)
    sim.set_speed(0)
    run(7.0)
    sim.set_speed(1)
    run(2.0)
    # three machines are one device here: it does each step three times
    assert device.time - before == pytest.approx(3 * 12_000_000, rel=0.01)


def test_a_host_is_waited_for_in_real_time() -> None:
    device, watch = FakePlc(), Watchdog()
    device.tempo = 10.0
    watch.telegram()
    device._hold.take([1, 7, 0, 0])
    for _ in range(499):
        device.step()
        watch.step(1.0, device.dt / device.tempo)
    assert device.hold == 1, "500 ms of the host's, 5 s of the plant's"
    for _ in range(3):
        device.step()
    assert device.hold == 0
    assert [watch.step(1.0, device.dt / device.tempo) for _ in range(600)].count(True) == pytest.approx(98, abs=3)


def test_heartbeats_that_a_paused_device_hears_do_not_pile_up() -> None:
    device = FakePlc()
    for beat in range(1000):
        device.write(6, plc_map.HEADER + plc_map.AT_HOST_HEARTBEAT, [beat])
    assert len(device._pending) == 1
