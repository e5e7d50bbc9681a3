"""The gate over the memory link to the virtual E800: real telegrams."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import replace

import pytest

from app.access.roles import Person
from app.commands.gate import Gate, Question
from app.commands.lifecycle import Progress, ProgressState
from app.commands.orders import AuditLine
from app.errors import Refused
from app.links.register_link import RegisterLink, statistic_names
from app.plant.derive import Derivation
from app.registers.pdu import parse_request
from app.sim import training
from app.sim.plant import SimPlant, exchange
from app.tags.batch import Batch
from app.tags.database import Tag, TagDatabase
from tests.commands.stand import ANA, EVA, IVO, demo_plant
from tests.virtual import loop_clock

QUICK = {"F113": 10.0, "F114": 2.0, "F115": 2.0, "F905": 1.0}
COMMAND = 0x2000


class Hall:
    """The demo plant's second machine, alive."""

    def __init__(self, simulation: Mapping[str, float] = QUICK) -> None:
        plant = demo_plant()
        item = plant.equipment["m2"]
        item = replace(item, options={**item.options, "simulation": simulation})
        self.plant = replace(plant, equipment={"m2": item})
        self.clock = loop_clock()
        self.sim = SimPlant(self.plant, self.clock)
        self.tags = TagDatabase(self.clock)
        self.captured: list[tuple[int, int]] = []
        bus = self.sim.buses["hall"]

        async def carry(unit: int, pdu: bytes) -> bytes | None:
            if pdu[0] in (6, 16):
                request = parse_request(pdu)
                if request.write_address < training.BASE:
                    self.captured.append((request.write_address, request.words[0]))
            return await exchange(bus, unit, pdu)

        link = self.plant.links["hall"]
        self.link = RegisterLink(link, [item], self.tags, self.clock, exchange=carry)
        points = [p for p in self.plant.points.values() if p.register is None or p.register.readable]
        tags = [Tag(p.name, p.id, "derived" if p.derived else "link.hall") for p in points]
        tags += [Tag(name, name, "sys") for name in statistic_names(link, [item.unit])]
        self.tags.configure(tags)
        self.derivation = Derivation(self.plant)
        self.tags.subscribe(self._derive)
        self.lines: list[tuple[str, str]] = []
        self.alarms: list[str] = []
        self.gate = Gate(
            self.tags,
            self.clock,
            writers={"hall": self.link},
            audit=self._audit,
            on_stop_unconfirmed=self.alarms.append,
        )
        self.gate.configure(self.plant)

    async def _audit(self, line: AuditLine) -> None:
        if line.kind == "command":
            self.lines.append((line.object, line.result))

    def _derive(self, batch: Batch) -> None:
        if batch.source != "link.hall":
            return
        names = {n: (self.tags.sample(n).value, self.tags.sample(n).quality) for n in self.derivation.inputs}
        found = self.derivation.update(names, batch.time)
        handles = [self.tags.handle(name) for name, _, _ in found]
        values, qualities = [v for _, v, _ in found], [q for _, _, q in found]
        self.tags.publish(Batch("derived", 0, batch.time, batch.seen, handles, values, qualities=qualities))

    def value(self, key: str) -> float:
        value = self.tags.sample(f"m2.{key}").value
        return float(value) if isinstance(value, int | float) else float("nan")

    async def until(self, true: Callable[[], object], limit: float = 30.0) -> None:
        began = self.clock.monotonic()
        while not true():
            assert self.clock.monotonic() - began < limit, (self.gate.progress("m2"), self.value("status"))
            await asyncio.sleep(0.02)

    async def ask(self, command: str, who: Person = ANA, **asked: object) -> Progress:
        nonce = self.gate.nonces.issue(who.session)
        return await self.gate.ask(who, "m2", command, nonce=nonce, **asked)  # type: ignore[arg-type]

    async def ended(self, state: ProgressState, limit: float = 30.0) -> Progress:
        """Wait until the command at work is over, and expect how."""

        def over() -> bool:
            progress = self.gate.progress("m2")
            return progress is not None and progress.over

        await self.until(over, limit)
        progress = self.gate.progress("m2")
        assert progress is not None
        assert progress.state is state, progress
        return progress

    async def cause(self, **registers: int) -> None:
        addresses = {"fault": training.REG_MACHINE_FAULT, "line": training.REG_LINE_FAULT}
        for name, value in registers.items():
            await self.link.raw_write(2, addresses[name], [value])


@pytest.fixture
async def hall(request: pytest.FixtureRequest) -> AsyncIterator[Hall]:
    hall = Hall(getattr(request, "param", QUICK))
    tasks = [asyncio.create_task(work()) for work in (hall.sim.run, hall.link.run, hall.gate.run)]
    try:
        hall.gate.control.take(ANA, "m2")
        await hall.until(lambda: not hall.gate.why_not(ANA, "m2", "forward"))
        yield hall
    finally:
        await hall.gate.close()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def test_forward_setpoint_reverse_and_stop_are_accepted_and_confirmed(hall: Hall) -> None:
    assert (await hall.ask("forward")).state is ProgressState.ACCEPTED
    await hall.ended(ProgressState.CONFIRMED)
    assert (hall.value("status"), hall.value("frequency") > 0) == (1, True)
    await hall.until(lambda: hall.value("frequency") == 10.0)
    await hall.ask("set_frequency", argument="15,5", language="hr", expected=10.0, confirmed=True)
    await hall.ended(ProgressState.CONFIRMED)
    await hall.until(lambda: hall.value("frequency") == 15.5)
    with pytest.raises(Question):
        await hall.ask("reverse")
    await hall.ask("reverse", confirmed=True)
    await hall.ended(ProgressState.CONFIRMED)
    assert hall.value("status") == 2
    await hall.ask("stop", who=IVO)
    await hall.ended(ProgressState.CONFIRMED)
    assert hall.value("status") == 0
    assert [words for address, words in hall.captured if address == COMMAND][:2] == [1, 2]
    await hall.until(lambda: len(hall.lines) >= 4)  # lines are written beside the commands
    assert hall.lines == [
        ("m2.forward", "confirmed"),
        ("m2.set_frequency", "confirmed"),
        ("m2.reverse", "confirmed"),
        ("m2.stop", "confirmed"),
    ]


async def test_a_drive_in_fault_does_not_start_and_is_reset_once_the_cause_is_gone(hall: Hall) -> None:
    await hall.cause(fault=13)
    await hall.until(lambda: hall.value("status") == 13)
    captured = len(hall.captured)
    with pytest.raises(Refused) as refused:
        await hall.ask("forward")
    assert refused.value.params["label"] == "missing.permissive.no_fault"
    assert len(hall.captured) == captured
    progress = await hall.ask("reset")
    assert (progress.state, progress.params["code"]) == (ProgressState.FAILED, 4)
    await hall.cause(fault=0)
    await asyncio.sleep(5.1)
    await hall.ask("reset")
    await hall.ended(ProgressState.CONFIRMED)
    await hall.until(lambda: not hall.gate.why_not(ANA, "m2", "forward"))
    await hall.ask("forward")
    await hall.ended(ProgressState.CONFIRMED)


async def test_parameters_are_written_and_read_back(hall: Hall) -> None:
    hall.gate.control.release(ANA, "m2")
    hall.gate.control.take(EVA, "m2")
    nonce = hall.gate.nonces.issue(EVA.session)
    await hall.gate.set_value(EVA, "m2", "f114", "3,5", nonce=nonce, language="de", confirmed=True)
    await hall.ended(ProgressState.CONFIRMED)
    assert hall.value("f114") == 3.5
    assert (0x010E, 35) in hall.captured


async def test_a_pulled_cable_makes_a_start_unknown_and_a_stop_is_tried_until_it_is_back(hall: Hall) -> None:
    await hall.ask("forward")
    await hall.ended(ProgressState.CONFIRMED)
    await hall.cause(line=1)
    await hall.ask("stop")
    await hall.until(lambda: hall.value("status") != hall.value("status"))  # no value any more
    with pytest.raises(Refused) as refused:
        await hall.ask("forward")
    assert refused.value.status in (409, 503)
    before = len(hall.captured)
    await asyncio.sleep(1.2)
    assert len(hall.captured) > before
    await hall.cause(line=0)
    await hall.ended(ProgressState.CONFIRMED, limit=9)
    assert 1 not in [words for address, words in hall.captured[before:] if address == COMMAND]
    assert hall.alarms == []


async def test_hold_to_run_moves_at_the_jog_frequency_stops_in_silence_and_restores_the_setpoint(hall: Hall) -> None:
    nonce = hall.gate.nonces.issue(ANA.session)
    lease = await hall.gate.hold.arm(ANA, "m2", "jog_reverse", nonce=nonce)
    for counter in range(1, 12):
        hall.gate.hold.keep_alive(lease, counter, ANA.session)
        await asyncio.sleep(0.15)
    assert hall.value("status") == 2
    assert 0 < hall.value("frequency") <= 5.0
    assert hall.value("frequency_setpoint") == 5.0
    await hall.until(lambda: hall.value("status") == 0, 3.0)  # nobody says anything any more
    progress = await hall.ended(ProgressState.CONFIRMED)
    assert progress.reason == "hold.cause.lost"
    await hall.until(lambda: hall.value("frequency_setpoint") == 10.0)


@pytest.mark.parametrize("later", [0.0, 0.1, 0.3, 0.45])
async def test_a_stop_while_the_former_setpoint_is_given_back_does_not_write_it_once_more(
    hall: Hall, later: float
) -> None:
    lease = await hall.gate.hold.arm(ANA, "m2", "jog_forward", nonce=hall.gate.nonces.issue(ANA.session))
    for counter in range(1, 8):
        hall.gate.hold.keep_alive(lease, counter, ANA.session)
        await asyncio.sleep(0.15)
    before = len(hall.captured)
    hall.gate.hold.release(lease, ANA.session)
    await hall.until(lambda: any(address != COMMAND for address, _ in hall.captured[before:]))
    await asyncio.sleep(later)
    await hall.gate.ask(ANA, "m2", "stop")
    await asyncio.sleep(3.0)
    assert [written for written in hall.captured[before:] if written[0] != COMMAND] == [(0x010D, 1000), (0x2001, 3)]
    assert hall.value("frequency_setpoint") == 10.0


async def test_what_was_changed_at_the_keypad_is_read_when_a_command_does_nothing(hall: Hall) -> None:
    """The drive echoes a start that F200 forbids it; the next one is refused by name, without a telegram."""
    await hall.link.raw_write(2, 0x0200, [0])
    await hall.ask("forward")
    await hall.ended(ProgressState.UNCONFIRMED)
    await hall.until(lambda: hall.value("f200") == 0)
    sent = len(hall.captured)
    with pytest.raises(Refused) as refused:
        await hall.ask("forward")
    assert refused.value.params["label"] == "missing.permissive.start_source"
    assert len(hall.captured) == sent


async def test_a_stop_that_the_keypad_forbids_says_why_at_the_next_look(hall: Hall) -> None:
    await hall.ask("forward")
    await hall.ended(ProgressState.CONFIRMED)
    await hall.link.raw_write(2, 0x0201, [0])
    await hall.ask("stop")
    await hall.ended(ProgressState.UNCONFIRMED)
    assert hall.alarms == ["m2"]
    await hall.until(lambda: hall.value("f201") == 0)
