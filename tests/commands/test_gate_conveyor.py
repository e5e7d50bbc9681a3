"""The gate over the memory link to the virtual PLC of the conveyor: real telegrams, real time, lost answers and a server that dies."""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from pathlib import Path

import pytest

from app.access.roles import Person
from app.commands.gate import Gate
from app.commands.lifecycle import Progress, ProgressState
from app.commands.orders import AuditLine
from app.errors import Refused
from app.links.register_link import RegisterLink, statistic_names
from app.plant.derive import Derivation
from app.plant.loader import read_plant
from app.registers import plc_map
from app.registers.pdu import parse_request
from app.sim.plant import SimPlant, exchange
from app.tags.batch import Batch
from app.tags.database import Tag, TagDatabase
from app.tags.quality import NO_DATA
from tests.commands.stand import ANA, EVA
from tests.virtual import loop_clock

PLANT = """
[plant]
name = "Line"
timezone = "UTC"
languages = ["en"]
[links.line]
transport = "memory"
writes = true
[equipment.c1]
type = "conveyor"
link = "line"
unit = 1
preset = "model"
simulation = { start = "stopped", arrivals = 0 }
"""


class Line:
    """One conveyor, alive."""

    def __init__(self, folder: Path) -> None:
        (folder / "plant.toml").write_text(PLANT, "utf-8")
        plant, problems = read_plant(folder)
        assert plant is not None, problems
        self.clock = loop_clock()
        self.sim = SimPlant(plant, self.clock)
        self.tags = TagDatabase(self.clock)
        self.orders: list[int] = []
        """Codes that reached the device."""
        self.bits: list[tuple[int, int]] = []
        self.swallow: Counter[int] = Counter()
        """Address → how many answers to a write there are lost after it acted."""
        self.drop: Counter[int] = Counter()
        """Address → how many telegrams do not arrive at all."""
        bus = self.sim.buses["line"]

        async def carry(unit: int, pdu: bytes) -> bytes | None:
            request = parse_request(pdu) if pdu[0] in (6, 16) else None
            if request is not None and self.drop[request.write_address] > 0:
                self.drop[request.write_address] -= 1
                return None
            answer = await exchange(bus, unit, pdu)
            if request is None:
                return answer
            if request.write_address == plc_map.COMMAND:
                self.orders.append(request.words[0])
            if request.write_address == plc_map.HOLD:
                self.bits.append((request.words[0], request.words[1]))
            if self.swallow[request.write_address] > 0:
                self.swallow[request.write_address] -= 1
                return None
            return answer

        item = plant.equipment["c1"]
        self.link = RegisterLink(plant.links["line"], [item], self.tags, self.clock, exchange=carry)
        tags = [Tag(p.name, p.id, "link.line") for p in plant.points.values() if p.register]
        tags += [Tag(p.name, p.id, "derived") for p in plant.points.values() if p.derived]
        tags += [Tag(name, name, "sys") for name in statistic_names(plant.links["line"], [item.unit])]
        self.tags.configure(tags)
        self._derive(Derivation(plant))
        self.results: list[tuple[str, str, str]] = []
        self.alarms: list[str] = []
        self.gate = Gate(
            self.tags,
            self.clock,
            writers={"line": self.link},
            audit=self._audit,
            on_stop_unconfirmed=self.alarms.append,
        )
        self.gate.configure(replace(plant, equipment={"c1": item}))

    def _derive(self, derivation: Derivation) -> None:
        """What comes from the options of the machine."""
        now = self.clock.micros()
        found = derivation.update({name: (None, NO_DATA) for name in derivation.inputs}, now)
        handles, values = [self.tags.handle(name) for name, _, _ in found], [value for _, value, _ in found]
        self.tags.publish(Batch("derived", 0, now, now, handles, values, qualities=[word for _, _, word in found]))

    def _audit(self, line: AuditLine) -> None:
        if line.kind == "command":
            self.results.append((line.object, line.result, line.reason))

    def value(self, key: str) -> float:
        value = self.tags.sample(f"c1.{key}").value
        return float(value) if isinstance(value, int | float) else float("nan")

    async def until(self, true: Callable[[], object], limit: float = 30.0) -> None:
        began = self.clock.monotonic()
        while not true():
            assert self.clock.monotonic() - began < limit, (self.gate.progress("c1"), self.value("state"), self.results)
            await asyncio.sleep(0.02)

    async def ask(self, command: str, who: Person = EVA, **asked: object) -> Progress:
        nonce = self.gate.nonces.issue(who.session)
        asked = {"confirmed": True, "reason": "test"} | asked
        return await self.gate.ask(who, "c1", command, nonce=nonce, **asked)  # type: ignore[arg-type]

    async def ended(self, limit: float = 30.0) -> Progress:
        await self.until(lambda: (progress := self.gate.progress("c1")) is not None and progress.over, limit)
        progress = self.gate.progress("c1")
        assert progress is not None
        return progress

    async def done(self, command: str, **asked: object) -> Progress:
        await self.until(lambda: not self.gate.why_not(EVA, "c1", command))
        await self.ask(command, **asked)
        progress = await self.ended()
        assert progress.state is ProgressState.CONFIRMED, progress
        return progress


@pytest.fixture
async def line(tmp_path: Path) -> AsyncIterator[Line]:
    line = Line(tmp_path)
    tasks = [asyncio.create_task(work()) for work in (line.sim.run, line.link.run, line.gate.run)]
    try:
        line.gate.control.take(EVA, "c1")
        await line.until(lambda: line.value("mode") == 0 or line.value("state") >= 0)
        await line.until(lambda: not line.gate.why_not(EVA, "c1", "select_manual"))
        yield line
    finally:
        await line.gate.close()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def press(line: Line, command: str) -> str:
    await line.until(lambda: not line.gate.why_not(EVA, "c1", command))
    return await line.gate.hold.arm(EVA, "c1", command, nonce=line.gate.nonces.issue(EVA.session))


async def hold(line: Line, lease: str, seconds: float, begin: int = 1) -> int:
    counter = begin
    ends = line.clock.monotonic() + seconds
    while line.clock.monotonic() < ends:
        line.gate.hold.keep_alive(lease, counter, EVA.session)
        counter += 1
        await asyncio.sleep(0.1)
    return counter


async def test_automatic_is_started_and_stopped(line: Line) -> None:
    await line.done("select_automatic")
    assert (line.value("mode"), line.value("automatic"), line.value("moving")) == (1, 0, 0)
    await line.done("start_automatic")
    assert line.value("automatic") == 1
    found = await line.gate.ask(ANA, "c1", "stop")
    assert found.state is ProgressState.ACCEPTED
    assert (await line.ended()).state is ProgressState.CONFIRMED
    assert (line.value("automatic"), line.value("moving")) == (0, 0)
    assert line.orders[:2] == [9, 1] and set(line.orders[2:]) == {2}, "only Stop is repeated, until it is read back"


async def test_a_lost_echo_is_cleared_up_by_the_answers_and_nothing_is_sent_twice(line: Line) -> None:
    line.swallow[plc_map.COMMAND] = 1
    found = await line.ask("select_manual")
    assert found.state is ProgressState.ACCEPTED
    assert (await line.ended()).state is ProgressState.CONFIRMED
    assert line.orders == [3]


async def test_a_telegram_that_never_arrived_has_failed_and_is_not_sent_again(line: Line) -> None:
    line.drop[plc_map.COMMAND] = 1
    found = await line.ask("select_manual")
    assert (found.state, found.reason) == (ProgressState.FAILED, "why.not_arrived")
    await asyncio.sleep(0.5)
    assert (line.orders, line.value("mode")) == ([], 0)


async def test_the_device_says_in_its_own_words_why_not(line: Line) -> None:
    found = await line.ask("delete_product", arguments={"product": 77})
    assert (found.state, found.reason) == (ProgressState.FAILED, "why.device_rejected")
    assert found.params["label"] == "reason.no_such_product"


async def test_a_product_is_put_moved_and_deleted(line: Line) -> None:
    await line.done("select_manual")
    await line.done("insert_product", arguments={"head": 60, "length": 25})
    await line.until(lambda: line.value("product_1_head") == pytest.approx(60))
    product = line.value("product_1_id")
    await line.done("edit_product", arguments={"product": product, "head": 80.5, "length": 25})
    await line.until(lambda: line.value("product_1_head") == pytest.approx(80.5))
    await line.done("delete_product", arguments={"product": product})
    await line.until(lambda: line.value("product_1_id") == 0)


async def test_the_line_moves_while_the_button_is_held_and_stands_after_it(line: Line) -> None:
    await line.done("select_manual")
    lease = await press(line, "jog_reverse")
    await hold(line, lease, 1.5)
    assert line.value("reverse") == 1
    assert line.value("belt_speed_1") < 0
    line.gate.hold.release(lease, EVA.session)
    await line.until(lambda: line.value("moving") == 0, 1.5)
    assert (await line.ended()).state is ProgressState.CONFIRMED
    assert line.bits[-1][0] == 0
    counters = [counter for _, counter in line.bits]
    assert len(set(counters)) == len(counters)
    assert {bits for bits, _ in line.bits} == {2, 0}


async def test_a_server_that_dies_while_a_button_is_held_lets_the_device_stop(line: Line) -> None:
    await line.done("select_manual")
    lease = await press(line, "jog_forward")
    await hold(line, lease, 1.0)
    assert line.value("moving") == 1
    sent = len(line.bits)
    line.drop[plc_map.HOLD] = 10**6  # from here on nothing of the server reaches the device, the release neither
    await line.until(lambda: line.value("moving") == 0, 2.0)
    assert len(line.bits) == sent
    await line.until(lambda: line.gate.hold.active("c1") is None, 1.0)
    line.drop.clear()
    assert (await line.ended(12)).reason == "hold.cause.lost"


async def test_a_line_that_lets_nothing_through_ends_the_hold_although_the_button_is_held(line: Line) -> None:
    await line.done("select_manual")
    lease = await press(line, "jog_forward")
    counter = await hold(line, lease, 0.8)
    line.drop[plc_map.HOLD] = 10**6
    with pytest.raises(Refused, match="lease_over"):
        await hold(line, lease, 5, counter)
    await line.until(lambda: line.value("moving") == 0, 2.0)
    line.drop.clear()
    assert (await line.ended(12)).reason == "hold.cause.write"


async def test_a_stop_over_a_held_button_wins(line: Line) -> None:
    await line.done("select_manual")
    lease = await press(line, "jog_forward")
    await hold(line, lease, 0.8)
    await line.gate.ask(ANA, "c1", "stop")
    assert (await line.ended()).state is ProgressState.CONFIRMED
    assert line.value("moving") == 0
    assert line.bits[-1][0] == 0
    await asyncio.sleep(0.5)
    assert line.value("moving") == 0


async def test_setpoints_are_taken_as_a_set_and_read_back(line: Line) -> None:
    nonce = line.gate.nonces.issue(EVA.session)
    await line.gate.set_value(EVA, "c1", "manual_speed", 12, nonce=nonce, confirmed=True)
    assert (await line.ended()).state is ProgressState.CONFIRMED
    assert line.value("manual_speed") == pytest.approx(12)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("seconds", [1.5, 4.0, 12.0])
async def test_a_program_that_stands_still_ends_the_hold_and_nothing_moves_when_it_goes_on(
    line: Line, seconds: float
) -> None:
    await line.done("select_manual")
    lease = await press(line, "jog_forward")
    counter = await hold(line, lease, 1.0)
    device = line.sim.devices["c1"]
    step, device.step = device.step, lambda: None  # type: ignore[method-assign]
    began = line.clock.monotonic()
    with pytest.raises(Refused, match="lease_over"):
        await hold(line, lease, 5, counter)
    assert line.clock.monotonic() - began < 2.0
    assert line.gate.hold.active("c1") is None
    await asyncio.sleep(seconds)
    device.step = step  # type: ignore[method-assign]
    await asyncio.sleep(0.05)
    await line.until(lambda: line.value("moving") == 0, 1.0)
    await asyncio.sleep(2.0)
    assert line.value("moving") == 0
    assert line.bits[-1][0] == 0
