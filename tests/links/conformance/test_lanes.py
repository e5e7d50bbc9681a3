"""A conveyor with more than usual (belts, sensors, a scanner, gates, merging lanes) is judged by the map of such a one."""

from functools import cache
from pathlib import Path
from struct import pack
from tempfile import TemporaryDirectory

import pytest

from app.links.conformance.finding import State
from app.links.tcp import TcpTransport
from app.plant import types
from app.plant.definitions import Link, Plant
from app.plant.loader import read_plant
from app.plant.type_files.data import TypeData
from app.registers import plc_map
from app.sim.server import serve_tcp
from tests.links.conformance.servers import Faulty, Put, judged, reading, rules_in, scanning

BELTS = Path(__file__).parents[3] / "plants" / "belts" / "plant.toml"
LANES = "merges = 2\nmerge_1_at = 780\nmerge_1_gap = 30\nmerge_2_at = 1250\nmerge_2_gap = 30\n"
HAS = {"belts": 5.0, "sensors": 8.0, "scanner": 2.0, "gates": 2.0, "merges": 2.0}
MERGE, LIMITS, SCANNER, INFEED = 0x2700, 0x2740, 0x2800, 0x3800


@cache
def plant() -> Plant:
    with TemporaryDirectory() as folder:
        text = BELTS.read_text("utf-8").replace("simulation = {", f"{LANES}simulation = {{ lane_interval = 5,")
        (Path(folder) / "plant.toml").write_text(text, "utf-8")
        found, problems = read_plant(Path(folder))
    assert found, problems
    return found


@cache
def data() -> TypeData:
    found, problems = types.read_type("conveyor", ["en"], given=HAS)
    assert problems == []
    return found


class NoLanes(Faulty):
    """Refuses the image of the merging gates."""

    def refuses(self, pdu: bytes) -> int:
        return 2 if reading(pdu, MERGE) else 0


class Older(Put):
    """Serves map 1.5, which has no lanes."""

    def __init__(self, bus: object, unit: int) -> None:
        super().__init__(bus, unit, {plc_map.AT_MINOR: 5})  # type: ignore[arg-type]

    def refuses(self, pdu: bytes) -> int:
        return 2 if any(reading(pdu, address) for address in (MERGE, LIMITS, INFEED)) else 0


@pytest.mark.real_time
async def test_a_line_with_lanes_keeps_every_rule_over_tcp() -> None:
    async with scanning("conveyor", plant()) as (bus, unit):
        served = await serve_tcp(bus, "127.0.0.1", 0)
        transport = TcpTransport(Link("line", "tcp", host=served.address[0], tcp_port=served.address[1]))
        await transport.connect()

        async def exchange(pdu: bytes) -> bytes:
            return await transport.exchange(unit, pdu, 2.0)

        found = await judged(exchange, "conveyor", data=data())
        await transport.close()
        await served.close()
    broken = rules_in(found, State.BROKEN) - {"timing", "device_time"}  # how fast this machine is: no subject of a test
    assert not broken, [found[rule] for rule in broken]
    assert {found[rule].state for rule in ("images", "generation", "spare", "values", "tables", "rows")} == {State.KEPT}


BREAKS = [
    ("generation", {MERGE: lambda old: old + 1}, "0x2700"),
    ("values", {MERGE + 2: 9}, "0x2702 = 9"),
    ("values", {MERGE + 0x0B: 3}, "0x270B = 3"),
    ("spare", {MERGE + 0x13: 7}, "0x2713 = 7"),
    ("tables", {INFEED + 3: 9}, "0x3803 = 9"),
]


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("rule", "words", "seen"), BREAKS)
async def test_what_a_lane_breaks_is_named(rule: str, words: dict[int, int], seen: str) -> None:
    async with scanning("conveyor", plant()) as (bus, unit):
        found = await judged(Put(bus, unit, dict(words)), "conveyor", write=False, data=data())
    assert rules_in(found, State.BROKEN) == {rule}
    assert seen in found[rule].seen


@pytest.mark.sweep(8)
async def test_a_server_without_the_image_of_its_lanes_is_told_which() -> None:
    async with scanning("conveyor", plant()) as (bus, unit):
        found = await judged(NoLanes(bus, unit), "conveyor", write=False, data=data())
    assert rules_in(found, State.BROKEN) == {"images"}
    assert found["images"].seen.startswith("0x2700–0x2723: exception 02")


async def test_one_of_a_map_without_lanes_is_not_asked_for_them() -> None:
    async with scanning("conveyor", plant()) as (bus, unit):
        found = await judged(Older(bus, unit), "conveyor", write=False, data=data())
    assert rules_in(found, State.BROKEN) == set()


async def test_a_number_that_stands_where_there_is_no_number_is_named() -> None:
    one, other = pack(">f", 1.5)[:2], pack(">f", float("nan"))[:2]
    place = 0x2106  # of a belt that this line does not have: NaN there is right
    async with scanning("conveyor", plant()) as (bus, unit):
        found = await judged(Put(bus, unit, {place: int.from_bytes(one, "big")}), "conveyor", write=False, data=data())
        assert f"0x{place:04X} = {int.from_bytes(one, 'big')}" in found["spare"].seen
        found = await judged(
            Put(bus, unit, {place: int.from_bytes(other, "big")}), "conveyor", write=False, data=data()
        )
    assert found["spare"].state is State.KEPT
