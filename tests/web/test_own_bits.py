"""A machine of a plant folder that lives in bits and in numbers of 64 bits: shown, commanded, set, stored, exported."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.plant.plant_files.languages import LANGUAGES
from app.registers.codec import encode
from app.registers.register import Order, Register, Type
from app.settings import Settings
from app.sim.bus import Bus
from app.sim.server import TcpServer
from tests.links.table_device import TableDevice
from tests.plant.test_own_types import written
from tests.virtual import VirtualClient, house
from tests.web.operating import Operator, line_of, runtime_of, until, words
from tests.web.people import Staff

PLANT = """
[plant]
name = "Waterworks"
timezone = "Europe/Zagreb"
languages = ["hr", "en", "de", "cs"]
[links.line]
transport = "tcp"
host = "127.0.0.1"
writes = true
[equipment.r1]
type = "rack"
link = "line"
unit = 1
label = "Rack 1"
"""
DEVICE = 'label = "type"\ntile = ["running", "energy"]\n[device]\nread_functions = [1, 2, 3, 4]\nwrite_functions = [5]\nmax_write = 4\n'
POINTS = """
[switch]
address = "00011"
writable = true
texts = [0, 1]
[running]
address = "10011"
texts = [0, 1]
[door]
address = 11
table = "discrete"
[energy]
address = 10
type = "u64"
order = "cdab"
unit = "Wh"
[balance]
address = 14
type = "i64"
[exact]
address = 18
type = "f64"
decimals = 3
"""
SETPOINTS = '[heater]\naddress = 20\ntable = "coil"\noptions = [0, 1]\ngroup = "group.g"\nrole = "operator"\n'
COMMANDS = """
[start]
writes = [{ point = "switch", value = 1 }]
feedback = "running == 1"
timeout = 2
[stop]
writes = [{ point = "switch", value = 0 }]
feedback = "running == 0"
stop = true
moves = false
"""
TEXTS = """
type = "Rack"
area = "Racks"
command.start = "Start"
command.stop = "Stop"
group.g = "Group"
[point]
switch = "Switch"
running = "Running"
door = "Door"
energy = "Energy"
balance = "Balance"
exact = "Exact"
heater = "Heater"
[choice]
switch = { 0 = "off", 1 = "on" }
running = { 0 = "stands", 1 = "runs" }
heater = { 0 = "cold", 1 = "warm" }
"""
MOST, LEAST = 2**64 - 1, -(2**63)


class Rack(TableDevice):
    """Its motor follows the switch as long as it is not stuck."""

    stuck = False

    def read(self, function: int, address: int, count: int) -> list[int]:
        if not self.stuck:
            motors = self.tables["discrete"].keys() & {10, 110}
            self.tables["discrete"] |= {at: self.tables["coil"][at] for at in motors}
        return super().read(function, address, count)


@pytest.fixture
def rack() -> Rack:
    words = dict[int, int]()
    for at, kind, order, value in (
        (10, Type.U64, Order.CDAB, MOST), (14, Type.I64, Order.ABCD, LEAST), (18, Type.F64, Order.ABCD, 1e300),
    ):  # fmt: skip
        words |= enumerate(encode(Register(at, kind, order, words=4), value), at)
    return Rack({"coil": dict.fromkeys(range(32), 0), "discrete": dict.fromkeys(range(32), 0), "holding": words})


@pytest.fixture
def client(tmp_path: Path, rack: Rack) -> Iterator[VirtualClient]:
    folder = tmp_path / "plant"
    written(folder, PLANT, "rack", device=DEVICE, points=POINTS, setpoints=SETPOINTS, commands=COMMANDS, texts_en=TEXTS)
    with house(Settings(plant=folder, data=tmp_path / "data")) as browser:
        assert runtime_of(browser).problems == []
        server = TcpServer(Bus({1: rack}))
        browser.run(server.start("127.0.0.1", 502))
        tags = runtime_of(browser).tags
        assert until(lambda: tags.sample("r1.heater").value is not None, 20)
        yield browser
        browser.run(server.close())


def test_what_a_language_lacks_is_shown_in_another_one_with_its_mark(client: VirtualClient) -> None:
    staff = Staff(client)
    staff.enter("ana", "engineer", "operator")
    staff.client.cookies.set("pogon_lang", "de")
    for path, shown in (
        ("/equipment/r1", ("[en] Door", "[en] stands", "[en] Start", "[en] Stop")),
        ("/equipment/r1/faceplate", ("[en] Door", "[en] stands", "[en] Stop")),
        ("/equipment/r1/parameters", ("[en] Heater", "[en] cold", "[en] Group")),
        ("/", ("[en] Running", "[en] stands")),
    ):
        page = words(staff.client.get(path).text)
        assert [one for one in shown if one not in page] == [], path
        assert re.findall(r"\[(?:point|choice|command|group)\.[^]]*", page) == [], path


@pytest.mark.sweep(8)
def test_a_command_writes_a_coil_and_is_done_when_the_machine_says_so(client: VirtualClient, rack: Rack) -> None:
    ana, tags = Operator(Staff(client), "ana", ("engineer", "operator")), runtime_of(client).tags
    page = words(ana.get("/equipment/r1", fragment=False).text)
    assert "stands" in page and "Door 0" in page and "off" in page
    ana.take("r1")
    ana.press("/equipment/r1/command/start")
    assert until(lambda: tags.sample("r1.running").value == 1, 5)
    client.pass_time(1)
    assert "Done" in words(ana.get("/equipment/r1/commands").text) and rack.tables["coil"][10] == 1
    assert "Stop" in line_of(ana.post("/equipment/r1/stop")) and until(lambda: rack.tables["coil"][10] == 0, 5)
    client.pass_time(3)

    rack.stuck = True
    ana.press("/equipment/r1/command/start")
    client.pass_time(4)
    told = words(ana.get("/equipment/r1/commands").text)
    assert "Done" not in told and rack.tables["coil"][10] == 1, "the coil was taken, and nobody calls that done"
    rack.functions = (1, 2, 3, 4)
    ana.press("/equipment/r1/command/start")
    client.pass_time(4)
    assert "The device refused (exception 1): illegal function" in words(ana.get("/equipment/r1/commands").text)


def test_a_parameter_may_be_a_coil(client: VirtualClient, rack: Rack) -> None:
    ana, tags = Operator(Staff(client), "ana", ("engineer", "operator")), runtime_of(client).tags
    page = ana.get("/equipment/r1/parameters", fragment=False).text
    assert "cold" in words(page) and "warm" in words(page)
    ana.take("r1")
    answer = ana.press("/equipment/r1/setpoint/heater", argument="1", confirmed="1")
    assert answer.status_code < 400, answer.text
    assert until(lambda: tags.sample("r1.heater").value == 1, 5) and rack.tables["coil"][20] == 1


@pytest.mark.sweep(20)
def test_numbers_of_64_bits_are_drawn_stored_and_exported_in_every_language(client: VirtualClient, rack: Rack) -> None:
    tags = runtime_of(client).tags
    assert [tags.sample(f"r1.{key}").value for key in ("energy", "balance", "exact")] == [MOST, LEAST, 1e300]
    for at in range(3):
        rack.tables["holding"][13] = at
        client.pass_time(70)
    for language in LANGUAGES:
        ana = Operator(Staff(client), f"ana-{language}", ("engineer", "operator"), language)
        for path in (
            "/equipment/r1", "/", "/equipment/r1/faceplate", "/equipment/r1/parameters", "/communication", "/equipment/r1/page/values",
            "/trends?pen=r1.energy&pen=r1.balance&pen=r1.exact", "/communication/line/1/words",
        ):  # fmt: skip
            answer = ana.get(path, fragment=False)
            assert answer.status_code == 200, (path, answer.status_code, answer.text[:300])
        raw = words(ana.get("/communication/line/1/words").text)
        for told in ("00011", "10011", "00021", "40011"):
            assert told in raw, raw
        names = ",".join(("r1.energy", "r1.balance", "r1.exact", "r1.running"))
        series = ana.get(f"/history/series?tags={names}", fragment=False).json()["series"]
        assert [(one["tag"], one["last"][-1]) for one in series] == [
            ("r1.energy", 2 * 2**48 + 2**48 - 1), ("r1.balance", float(LEAST)), ("r1.exact", 1e300), ("r1.running", 0.0),
        ]  # fmt: skip
        csv = ana.get(f"/history/export.csv?tags={names}&from=-1h&interval=0&locale={language}", fragment=False)
        assert csv.status_code == 200 and f"{2 * 2**48 + 2**48 - 1}" in csv.text


@pytest.mark.sweep(8)
def test_two_machines_behind_one_unit_are_commanded_and_shown_each_by_itself(tmp_path: Path, rack: Rack) -> None:
    second = PLANT[PLANT.index("[equipment.r1]") :].replace("r1", "r2").replace("Rack 1", "Rack 2") + "base = 100\n"
    folder = tmp_path / "plant"
    written(
        folder,
        PLANT + second,
        "rack",
        device=DEVICE,
        points=POINTS,
        setpoints=SETPOINTS,
        commands=COMMANDS,
        texts_en=TEXTS,
    )
    for table in rack.tables.values():
        table |= {at + 100: 0 for at in table}
    with house(Settings(plant=folder, data=tmp_path / "data")) as browser:
        server = TcpServer(Bus({1: rack}))
        browser.run(server.start("127.0.0.1", 502))
        tags, ana = runtime_of(browser).tags, Operator(Staff(browser), "ana", ("engineer", "operator"))
        assert until(lambda: [tags.sample(f"{name}.heater").value for name in ("r1", "r2")] == [0, 0], 20)
        assert (tags.sample("r1.energy").value, tags.sample("r2.energy").value) == (MOST, 0)
        ana.take("r2")
        ana.press("/equipment/r2/command/start")
        browser.pass_time(2)
        assert "Done" in words(ana.get("/equipment/r2/commands").text)
        assert [rack.tables["coil"][at] for at in (10, 110)] == [0, 1]
        ana.post("/equipment/r1/stop")
        browser.pass_time(2)
        assert [rack.tables["coil"][at] for at in (10, 110)] == [0, 1], "the Stop of one stops the other not"
        page = words(ana.get("/communication", fragment=False).text)
        assert "Rack 1" in page and "Rack 2" in page
        raw = words(ana.get("/communication/line/1/words").text)
        assert all(told in raw for told in ("r1.switch", "00011", "r2.switch", "00111", "40111"))
        assert ana.get("/equipment/r2", fragment=False).status_code == 200
        browser.run(server.close())
