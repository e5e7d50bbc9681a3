"""A type that a plant folder brings, as docs/own-machine.md writes it: read, shown, commanded, taken anew."""

import asyncio
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from struct import pack, unpack

import pytest

from app import bundled
from app.plant import types
from app.plant.loader import read_plant
from app.settings import Settings
from app.sim import type_tests
from app.sim.plant import read_simulated
from tests.conftest import ROOT
from tests.virtual import VirtualClient, house
from tests.web.operating import Operator, line_of, runtime_of, until, words
from tests.web.people import Staff

PAGE = (ROOT / "docs" / "own-machine.md").read_text("utf-8")
PORT = 502


def write(folder: Path, host: str = "127.0.0.1") -> Path:
    """The files of the page, each under the name that stands before it, in the order of the page."""
    text = PAGE.replace("192.168.0.20", host)
    names = re.findall(r"`((?:equipment/meter/)?\w+(?:\.en)?\.toml)`", text[text.index("A meter with") :])
    blocks = re.findall(r"```toml\n(.*?)```", text, re.S)
    assert len(names) == len(blocks) == 9
    for name, block in zip(names, blocks, strict=True):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(block, "utf-8")
    return folder


def mistakes(folder: Path) -> list[str]:
    return [str(problem) for problem in read_plant(folder)[1]]


class Meter(asyncio.Protocol):
    """The meter: a Modbus server of a few registers."""

    registers: dict[int, int]

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport, self.left = transport, b""

    def data_received(self, data: bytes) -> None:
        self.left += data
        while len(self.left) >= 12:
            head, request, self.left = self.left[:7], self.left[7:12], self.left[12:]
            answer = self.answer(*unpack(">BHH", request), request)
            self.transport.write(head[:4] + pack(">H", len(answer) + 1) + head[6:] + answer)

    def answer(self, function: int, address: int, number: int, request: bytes) -> bytes:
        if function == 6 and address in (20, 21):
            self.registers[14 if address == 20 else address] = number
            return request
        asked = range(address, address + number)
        if function != 3 or any(at not in self.registers for at in asked):
            return bytes((function | 0x80, 2))
        return bytes((3, 2 * number)) + b"".join(pack(">H", self.registers[at]) for at in asked)


def test_the_files_of_the_page_are_read_without_a_warning(tmp_path: Path) -> None:
    """`pogon check` said that it has no area."""
    plant, problems = read_plant(write(tmp_path))
    assert plant, problems
    assert [str(one) for one in plant.doubts] == [] and plant.equipment["p1"].area == "energy"


@pytest.fixture
def client(tmp_path: Path) -> Iterator[VirtualClient]:
    high, low = unpack(">HH", pack(">f", 5.25))
    Meter.registers = dict.fromkeys(range(10, 22), 0) | {10: low, 11: high, 12: 0, 13: 777, 21: 50}
    folder = write(tmp_path / "plant")
    with house(Settings(plant=folder, data=tmp_path / "data")) as browser:
        browser.run(browser.loop.create_server(Meter, "127.0.0.1", PORT))
        assert runtime_of(browser).problems == []
        tags = runtime_of(browser).tags
        assert until(lambda: tags.sample("p1.limit").value is not None, 20)
        yield browser


def test_it_is_shown_commanded_set_and_alarmed_without_a_template(client: VirtualClient) -> None:
    ana = Operator(Staff(client), "ana", ("engineer", "operator"))
    tags = runtime_of(client).tags
    assert [tags.sample(f"p1.{key}").value for key in ("power", "energy", "state", "limit")] == [5.25, 777, 0, 50]
    page = words(ana.get("/equipment/p1", fragment=False).text)
    for told in (
        "Energy meter",
        "Feeder 1",
        "Power 5.25 kW 0 – 12",
        "Energy 777 kWh",
        "off State unknown Energy meter",
        "Switch on",
    ):
        assert told in page
    assert "Rated power" not in page and "[" not in page[page.index("Energy meter") : page.index("Switch on")]
    face = ana.get("/equipment/p1/faceplate").text
    assert 'href="/equipment/p1/parameters"' in face
    face = words(face)
    assert "The meter answers" in face and "Power 5.25 kW" in face and "Switch off" in face
    tile = words(ana.get("/", fragment=False).text)
    assert "Power 5.25 kW" in tile and "Energy 777 kWh" in tile
    assert "Limit of the load" in words(ana.get("/equipment/p1/parameters", fragment=False).text)

    ana.take("p1")
    ana.press("/equipment/p1/command/on")
    assert until(lambda: tags.sample("p1.state").value == 1, 5)
    client.pass_time(1)
    assert "Done" in words(ana.get("/equipment/p1/commands").text)
    answer = ana.post("/equipment/p1/stop")
    assert "Switch off" in line_of(answer) and until(lambda: Meter.registers[14] == 0, 5)

    Meter.registers[10], Meter.registers[11] = reversed(unpack(">HH", pack(">f", 13.0)))
    assert until(lambda: [one.key for one in runtime_of(client).alarms.list.active()] == ["too_much"], 10)
    assert "Too much power" in words(ana.get("/alarms", fragment=False).text)


def test_a_reload_says_that_its_type_is_another_one(client: VirtualClient) -> None:
    runtime = runtime_of(client)
    points = Path(runtime.settings.plant or "") / "equipment" / "meter" / "points.toml"
    points.write_text(points.read_text("utf-8").replace("decimals = 2", "decimals = 1"), "utf-8")
    seen = client.run(runtime.plant_files.look())
    assert ("type", "meter") in [(one.what, one.name) for one in seen.changes]
    assert client.run(runtime.plant_files.reload(None, seen.digest)).done
    client.pass_time(5)
    assert runtime.plant is not None and runtime.plant.equipment["p1"].points["power"].decimals == 1
    assert runtime.tags.sample("p1.power").value == 5.25


@pytest.mark.parametrize(
    ("file", "old", "new", "told"),
    [
        ("points.toml", "address = 12", "adress = 12", "equipment/meter/points.toml"),
        ("points.toml", 'kind = "enum"', 'kind = "enom"', "equipment/meter/points.toml:20: state.kind"),
        ("device.toml", "low = 1\n", "low = 11\n", "equipment/meter/device.toml:13: options.rated_power.default = 10"),
        ("device.toml", 'label = "type"', 'label = "type"\nkin = "../../etc"', "expected another type: "),
        ("texts.en.toml", 'off = "Switch off"', "", "texts.en.toml: command.off = missing: expected a text in one of the languages"),
        ("alarms.toml", "power > rated_power", "powr > 1", "equipment/meter/alarms.toml:2: too_much.expression"),
    ],
)  # fmt: skip
def test_a_mistake_in_its_files_is_told_with_its_place(
    tmp_path: Path, file: str, old: str, new: str, told: str
) -> None:
    folder = write(tmp_path)
    path = folder / "equipment" / "meter" / file
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), "utf-8")
    assert any(told in one for one in mistakes(folder)), mistakes(folder)


@pytest.mark.sweep(8)
def test_every_type_of_ours_can_be_one_of_a_plant_and_has_pages_there(tmp_path: Path) -> None:
    folder, kinds = tmp_path / "plant", types.names()
    text = '[plant]\nname = "Yard"\ntimezone = "UTC"\n[links.l]\ntransport = "tcp"\nhost = "127.0.0.1"\nport = 502\n'
    for unit, kind in enumerate(kinds, 1):
        shutil.copytree(types.EQUIPMENT / kind, folder / "equipment" / f"our_{kind}")
        text += f'[equipment.{kind[:2]}{unit}]\ntype = "our_{kind}"\nlink = "l"\nunit = {unit}\n'
        text += 'preset = "model"\n' if kind == "conveyor" else ""
        text += 'definition = "coil_transport"\nmachine = "co1"\n' if kind == "sequence" else ""
    shutil.copytree(bundled("plants/demo") / "sequences", folder / "sequences")
    (folder / "plant.toml").write_text(text, "utf-8")
    with house(Settings(plant=folder, data=tmp_path / "data")) as browser:
        runtime = runtime_of(browser)
        assert runtime.plant is not None, runtime.problems
        assert {item.type.name for item in runtime.plant.equipment.values()} == {f"our_{kind}" for kind in kinds}
        ana = Operator(Staff(browser), "ana", ("engineer", "operator"))
        for machine in runtime.plant.equipment:
            for page in ("", "/faceplate", "/commands", "/events"):
                answer = ana.get(f"/equipment/{machine}{page}", fragment=page == "/commands")
                assert answer.status_code == 200 or page == "/events", (machine, page)
                assert not re.search(r"\[our_\w+\.\w|\[(point|command|choice)\.", words(answer.text)), (machine, page)
        assert ana.get("/", fragment=False).status_code == 200


def test_its_name_is_its_own(tmp_path: Path) -> None:
    folder = write(tmp_path)
    (folder / "equipment" / "meter").rename(folder / "equipment" / "epos")
    assert any(
        "equipment/epos: (folder) = epos: expected a name that no type of Pogon has" in one for one in mistakes(folder)
    )
    (folder / "equipment" / "epos").rename(folder / "equipment" / "My meter")
    assert any("equipment/My meter: (folder)" in one for one in mistakes(folder))


@pytest.mark.parametrize("name", ["bus", "plc", "training", "crane_2"])
def test_a_name_that_some_part_of_pogon_has_is_an_ordinary_one(tmp_path: Path, name: str) -> None:
    folder = write(tmp_path)
    (folder / "equipment" / "meter").rename(folder / "equipment" / name)
    plant = folder / "plant.toml"
    plant.write_text(plant.read_text("utf-8").replace('"meter"', f'"{name}"'), "utf-8")
    assert read_simulated(folder)[1] == []
    assert type_tests.tests_of(name) is None


def simulated(folder: Path) -> Path:
    """The plant of the page with its meter in the server."""
    plant = folder / "plant.toml"
    text = plant.read_text("utf-8").replace('"tcp"', '"memory"').replace('host = "127.0.0.1"\nport = 502\n', "")
    plant.write_text(text.replace("writes = true\n", ""), "utf-8")
    return folder


@pytest.mark.sweep(8)
def test_by_its_description_it_is_simulated_commanded_and_counts(tmp_path: Path) -> None:
    with house(Settings(plant=simulated(write(tmp_path / "plant")), data=tmp_path / "data")) as browser:
        assert runtime_of(browser).problems == []
        tags = runtime_of(browser).tags
        assert until(lambda: tags.sample("p1.state").value == 0 and tags.sample("p1.limit").value == 50, 20)
        ana = Operator(Staff(browser), "ana", ("engineer", "operator"))
        ana.take("p1")
        ana.press("/equipment/p1/command/on")
        assert until(lambda: tags.sample("p1.state").value == 1, 5)
        browser.pass_time(20)
        assert tags.sample("p1.power").value == pytest.approx(9.6, abs=0.15)
        assert until(lambda: tags.sample("p1.energy").value == 1251, 500)
        assert ana.get("/instructor/p1", fragment=False).status_code == 200


def test_without_a_description_it_has_no_virtual_device_and_none_of_its_python_is_run(tmp_path: Path) -> None:
    folder = write(tmp_path)
    own = folder / "equipment" / "meter"
    (own / "records.py").write_text("raise SystemExit('run')\n", "utf-8")
    (own / "__init__.py").write_text("raise SystemExit('run')\n", "utf-8")
    (own / "records.toml").write_text("[batch]\n", "utf-8")
    assert any("equipment/meter/records.toml" in one for one in mistakes(folder))
    (own / "records.toml").unlink()
    (own / "simulation.toml").unlink()
    (problem,) = read_simulated(simulated(folder))[1]
    assert problem.key == "equipment.p1.link"
    assert "equipment/meter/simulation.toml would describe one" in problem.expected


def test_a_link_out_of_the_plant_folder_is_not_followed(tmp_path: Path) -> None:
    folder = write(tmp_path / "plant")
    points = folder / "equipment" / "meter" / "points.toml"
    points.rename(tmp_path / "points.toml")
    points.symlink_to(tmp_path / "points.toml")
    assert any("equipment/meter/points.toml" in one and "a link that leads out" in one for one in mistakes(folder))
    points.unlink()
    (tmp_path / "points.toml").rename(points)
    (folder / "equipment").rename(tmp_path / "elsewhere")
    (folder / "equipment").symlink_to(tmp_path / "elsewhere")
    assert any("a link that leads out" in one for one in mistakes(folder))
