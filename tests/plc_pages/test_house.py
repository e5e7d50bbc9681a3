"""A PLC server written from docs/registers/ alone works: screens, commands, settings, events, records, history."""

import csv
import io
import math
from collections.abc import Iterator
from struct import pack
from typing import Any

import pytest

from app.settings import Settings
from tests.demo_plant import plant_file, plant_folder
from tests.plc_pages.page import Cell, read_page
from tests.plc_pages.server import ModbusTcp, PagePlc
from tests.virtual import VirtualClient, house
from tests.web.operating import Operator, runtime_of, until
from tests.web.people import Staff

UNITS = {
    "line": {11: ("c1", "conveyor")},
    "coil": {20: ("cc1", "coil_car"), 21: ("seq1", "sequence")},
    "crane": {30: ("cr1", "crane")},
}
PORTS = {"line": 5021, "coil": 5022, "crane": 5023}


def distinct(cell: Cell, n: int) -> float:
    """A number for a place that no other place has, as far as its form lets it."""
    if cell.choices:
        return cell.choices[n % len(cell.choices)]
    if cell.bit is not None:
        return n % 2
    return 1000.5 + n if cell.form == "f32" else 1000 + n


@pytest.fixture(scope="module")
def plcs() -> dict[str, PagePlc]:
    """Machine → its server, every named place with a number of its own."""
    found = {}
    for units in UNITS.values():
        for machine, kind in units.values():
            plc = found[machine] = PagePlc(read_page(kind))
            for n, cell in enumerate(plc.places.values()):
                plc.set(**{cell.name: distinct(cell, n)})
            for table in plc.page.tables:
                for slot in (1, 2):
                    plc.row(
                        table.name,
                        slot,
                        {cell.name: distinct(cell, 100 * slot + n) * cell.scale for n, cell in enumerate(table.cells)},
                    )
    return found


FOUND: dict[str, list[tuple[str, Any, float, bool]]] = {}
"""Machine → name, what the house shows, what the server sends, whether it is the same; looked at before anybody commands."""


def compare(client: VirtualClient, machine: str, plc: PagePlc) -> list[tuple[str, Any, float, bool]]:
    found = []

    def look(name: str, cell: Cell, begin: int = 0) -> None:
        sent = cell.number([plc.memory[begin + cell.at + n] for n in range(cell.words)]) * cell.scale
        shown = value(client, f"{machine}.{name}")
        found.append((name, shown, sent, shown is not None and math.isclose(float(shown), sent, rel_tol=1e-6)))

    for cell in (*plc.places.values(), *(plc.page.settings.cells if plc.page.settings else ())):
        look(cell.name, cell)
    for table in plc.page.tables:
        for slot in (1, 2):
            for cell in table.cells:
                look(f"{table.name}_{slot}_{cell.name}", cell, table.address + 4 + (slot - 1) * table.words)
    return found


@pytest.fixture(scope="module")
def client(plcs: dict[str, PagePlc], tmp_path_factory: pytest.TempPathFactory) -> Iterator[VirtualClient]:
    folder = plant_folder(tmp_path_factory.mktemp("plant") / "plant", "c1", "cc1", "seq1", "cr1")
    links = {name: f'transport = "tcp"\nhost = "127.0.0.1"\nport = {port}' for name, port in PORTS.items()}
    (folder / "plant.toml").write_text(plant_file(("c1", "cc1", "seq1", "cr1"), links), "utf-8")
    with house(Settings(plant=folder, data=tmp_path_factory.mktemp("data") / "data")) as browser:
        for link, units in UNITS.items():
            served = {unit: plcs[machine] for unit, (machine, _) in units.items()}
            browser.run(browser.loop.create_server(lambda served=served: ModbusTcp(served), "127.0.0.1", PORTS[link]))  # type: ignore[misc]
        tasks = [browser.loop.create_task(plc.run()) for plc in plcs.values()]
        tags = runtime_of(browser).tags
        assert until(
            lambda: tags.sample("c1.state").value is not None and tags.sample("cr1.state").value is not None, 30
        )
        browser.pass_time(3)
        FOUND.update({machine: compare(browser, machine, plc) for machine, plc in plcs.items()})
        yield browser
        for task in tasks:
            task.cancel()


@pytest.fixture(scope="module")
def ivo(client: VirtualClient) -> Operator:
    return Operator(Staff(client), "ivo", ("engineer", "operator"))


def value(client: VirtualClient, name: str) -> Any:
    return runtime_of(client).tags.sample(name).value


@pytest.mark.sweep(8)
@pytest.mark.parametrize("machine", ["c1", "cc1", "seq1", "cr1"])
def test_every_place_of_the_page_is_the_point_of_that_name(machine: str, client: VirtualClient) -> None:
    found = FOUND[machine]
    assert [one for one in found if not one[3]] == []
    assert len(found) > 25


def test_the_host_shows_that_it_is_alive_and_says_what_it_has_stored(
    client: VirtualClient, plcs: dict[str, PagePlc]
) -> None:
    plc = plcs["c1"]
    beats = len(plc.heartbeats)
    plc.tell("power_up", value=1.0)
    client.pass_time(3)
    assert len(plc.heartbeats) >= beats + 2 and len(set(plc.heartbeats[-2:])) == 2
    assert plc.acknowledged == plc.newest


def ready(plc: PagePlc) -> None:
    """A line that stands, in automatic, without faults."""
    plc.set(**{name: 0.0 for name in plc.places})
    plc.set(mode=1, device_belts=3, device_sensors=4, device_areas=4, slots=20, next_id=1)

    def start() -> str:
        plc.set(state=1, automatic=1, moving=1)
        return "automatic_started"

    def stop() -> str:
        plc.set(state=0, automatic=0, moving=0)
        return "stop"

    plc.does = {"start_automatic": start, "stop": stop, "commit": lambda: "settings_changed"}


@pytest.mark.sweep(8)
def test_a_line_is_started_and_stopped_set_and_told_of(
    client: VirtualClient, plcs: dict[str, PagePlc], ivo: Operator
) -> None:
    plc = plcs["c1"]
    ready(plc)
    gate = runtime_of(client).gate
    assert gate is not None
    assert until(lambda: value(client, "c1.state") == 0 and value(client, "c1.mode") == 1, 10)
    client.pass_time(2)
    ivo.take("c1")

    # a command: asked, answered, seen
    answer = ivo.press("/equipment/c1/command/start_automatic", confirmed="1")
    assert answer.status_code == 202, answer.text
    assert until(lambda: value(client, "c1.automatic") == 1, 5)
    assert until(lambda: (p := gate.progress("c1")) is None or p.over, 10)
    code, _, id = plc.asked[-1]
    assert code == plc.page.commands["start_automatic"][0]
    assert ">Automatic" in ivo.get("/equipment/c1", fragment=False).text
    audit = ivo.get("/audit?object=c1", fragment=False).text
    assert "start_automatic" in audit or "Start automatic" in audit

    # a setting: staged as a whole, committed, read back
    answer = ivo.press("/equipment/c1/setpoint/jerk", argument="300", confirmed="1")
    assert answer.status_code == 202, answer.text
    assert until(lambda: value(client, "c1.jerk") == 300, 10)
    assert plc.page.commands["commit"][0] in {asked[0] for asked in plc.asked}

    # events: a product from arriving to leaving, with what the snapshot says
    for name, source, number in (
        ("arrived", 1, 0.0),
        ("identified", 1, 33.25),
        ("head", 2, -0.5),
        ("unloaded", 0, 21.5),
    ):
        plc.tell(name, source, number, pack(">IIf", 4711, 0, 0.0))
        client.pass_time(0.5)
    assert until(lambda: plc.acknowledged == plc.newest, 10), "acknowledged only when stored"

    # stop
    assert ivo.press("/equipment/c1/command/stop").status_code == 202
    assert until(lambda: value(client, "c1.automatic") == 0, 5)
    assert until(lambda: plc.acknowledged == plc.newest, 10)

    page = ivo.get("/events?equipment=c1", fragment=False).text
    for said in ("Automatic started", "Settings changed", "Product discharged", "Stop"):
        assert said in page, said
    assert "ivo" in page, "who caused it: by the id of the command"
    assert id

    # what happened is there as CSV, as a record and as history
    sheet = ivo.get("/events/export.csv?equipment=c1", fragment=False)
    assert sheet.status_code == 200 and "4711" in sheet.text
    records = ivo.get("/records/passage/export.csv?equipment=c1", fragment=False)
    assert records.status_code == 200 and "4711" in records.text and "33.25" in records.text, records.text
    client.pass_time(5)
    export = ivo.get("/history/export.csv?tags=c1.automatic", fragment=False)
    assert export.status_code == 200
    values = [row[3] for row in csv.reader(io.StringIO(export.text)) if len(row) == 7 and row[2] == "c1.automatic"]
    assert [number for number in values if number][-3:] == ["0", "1", "0"]
