"""What a unit offers beside plain registers is a list: each service is asked in its order, and cares for what it takes."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import pytest

from app.errors import LinkError, NoAnswer, Refused, Rejected
from app.links import outages
from app.links.plc import PlcUnit
from app.links.services import Seen
from app.plant.definitions import Device, PlcMap, Register, UnitService
from app.registers import plc_map
from tests.links.devices import until
from tests.links.plc_devices import DEVICE, KINDS, SmallPlc, command_of, once, plant, small
from tests.links.test_orders import is_command


@dataclass(frozen=True, slots=True)
class Mailbox(UnitService):
    """What a type might say of another service."""

    address: int = 0x0100


class MailboxUnit:
    """Another service, which only notes what is asked of it."""

    made: ClassVar[list["MailboxUnit"]] = []
    right = True

    def __init__(self, road: Any, station: Any, definition: Mailbox) -> None:
        self.definition = definition
        self.asked: list[str] = []
        self.writes: list[Any] = []
        MailboxUnit.made.append(self)

    async def identify(self) -> bool:
        self.asked.append("identify")
        return MailboxUnit.right

    def begin(self) -> None:
        self.asked.append("begin")

    def adopt(self, before: Any) -> None:
        self.asked.append("adopt")

    async def end(self) -> None:
        self.asked.append("end")

    def reads(self, block: Any) -> bool:
        return False

    def seen(self, block: Any, words: list[int], started: float) -> Seen:
        raise AssertionError("nothing of it is read")

    def worth_reading(self, blocks: Any) -> list[Any]:
        return list(blocks)

    def takes(self, register: Register) -> bool:
        return register.address == self.definition.address

    async def write(self, writes: Any) -> None:
        self.writes += writes


@pytest.fixture
def mailbox(monkeypatch: pytest.MonkeyPatch) -> type[MailboxUnit]:
    monkeypatch.setattr(outages, "KINDS", {**outages.KINDS, Mailbox: MailboxUnit})
    MailboxUnit.made, MailboxUnit.right = [], True
    return MailboxUnit


BOTH = replace(DEVICE, services=(*DEVICE.services, Mailbox()))


def test_a_type_without_a_map_has_no_service() -> None:
    assert Device().services == () and Device().plc is None
    assert Device(services=(PlcMap(7),)).plc == PlcMap(7)


async def test_a_second_service_lives_beside_the_map(mailbox: type[MailboxUnit]) -> None:
    async with plant(SmallPlc(), equipment=[small(device=BOTH)]) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        station = line.link.stations[1]
        assert [type(service) for service in station.services] == [PlcUnit, MailboxUnit]
        box = station.service(MailboxUnit)
        assert box is not None and box.asked == ["identify", "begin"]
        await line.link.write_set("p", {"a": 4.0, "b": 5.0})
        assert box.writes == []  # the map takes its own
        line.link.renew([small(device=replace(BOTH, services=(*DEVICE.services, Mailbox(0x0999))))])
        assert MailboxUnit.made[-1].asked[0] == "adopt"
    assert MailboxUnit.made[-1].asked[-1] == "end"


async def test_a_unit_that_one_service_does_not_know_takes_no_writes(mailbox: type[MailboxUnit]) -> None:
    mailbox.right = False
    async with plant(SmallPlc(), equipment=[small(device=BOTH)]) as (line, _):
        await until(lambda: bool(MailboxUnit.made) and "identify" in MailboxUnit.made[0].asked)
        assert "begin" not in MailboxUnit.made[0].asked
        with pytest.raises(LinkError):
            await line.link.write("p", "a", 4.0)
        mailbox.right = True
        await until(lambda: line.value("p.state") == 1)
        await line.link.write("p", "a", 4.0)


async def test_points_are_grouped_by_what_takes_them_together() -> None:
    async with plant(SmallPlc()) as (line, _):
        together = line.link.together
        assert together("p", ["a", "b"]) == [["a", "b"]]
        assert together("p", ["a", "size", "b", "level"]) == [["a", "b"], ["size"], ["level"]]
        assert together("p", []) == []
        for wrong in (["a", "nothing"], ["x"]):
            with pytest.raises(LinkError):
                together("p", wrong)
        with pytest.raises(LinkError):
            together("q", ["a"])


@pytest.mark.parametrize("kind", KINDS)
async def test_a_set_is_one_commit(kind: str) -> None:
    device = SmallPlc()
    async with plant(device, kind) as (line, _):
        await until(lambda: line.value("p.c") == 3.0)
        await line.link.write_set("p", {"a": 4.0, "c": 6.0})
        assert (device.commits, device.settings) == (1, {"a": 4.0, "b": 2.0, "c": 6.0, "d": 0.0})
        await until(lambda: (line.value("p.a"), line.value("p.c")) == (4.0, 6.0))


async def test_of_a_set_with_one_wrong_value_nothing_is_taken() -> None:
    device = SmallPlc()
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.c") == 3.0)
        with pytest.raises(Rejected) as refused:
            await line.link.write_set("p", {"a": 4.0, "b": 50.0})
        assert refused.value.detail == 2
        assert (device.commits, device.settings["a"]) == (0, 1.0)


@pytest.mark.parametrize("values", [{"a": 1.0, "level": 2.0}, {"size": 1.0, "level": 2.0}])
async def test_what_is_not_one_set_is_not_written_as_one(values: dict[str, float]) -> None:
    device = SmallPlc()
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.c") == 3.0)
        with pytest.raises(LinkError):
            await line.link.write_set("p", values)
        assert device.commits == 0


async def test_a_set_whose_telegram_is_lost_is_told_to_be_unknown_or_not_to_have_arrived() -> None:
    device = SmallPlc()
    async with plant(device) as (line, bus):
        await until(lambda: line.value("p.c") == 3.0)
        bus.fault = once("request", is_command)
        with pytest.raises(LinkError) as lost:
            await line.link.write_set("p", {"a": 4.0, "c": 6.0})
        assert not isinstance(lost.value, NoAnswer) and device.commits == 0  # proven: its answers do not name it
        told = False

        def from_the_commit_on(pdu: bytes) -> str:
            nonlocal told
            told = told or command_of(pdu) == plc_map.COMMIT_SETTINGS
            return "request" if told else ""

        bus.fault = from_the_commit_on
        with pytest.raises(NoAnswer):
            await line.link.write_set("p", {"a": 4.0, "c": 6.0})


async def test_a_link_that_may_not_write_writes_no_set() -> None:
    device = SmallPlc()
    async with plant(device, writes=False) as (line, _):
        await until(lambda: line.value("p.c") == 3.0)
        with pytest.raises(Refused):
            await line.link.write_set("p", {"a": 4.0, "c": 6.0})
        assert device.commits == 0
