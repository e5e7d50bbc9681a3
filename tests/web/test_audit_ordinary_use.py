"""What ordinary use writes into the audit is read by a plant manager: no id, key, object or empty value of ours in any cell."""

import re
from collections.abc import Iterator
from html import unescape
from shutil import copytree

import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from app import bundled
from app.cli import cli
from app.settings import Settings
from tests.virtual import house
from tests.web.operating import Operator, runtime_of, until
from tests.web.people import PASSWORD, Staff
from tests.web.test_alarms import LANGUAGES, Hall

RAW = re.compile(
    r"/plants?/|/(?:equipment|users|audit|history)|one-shot|terminal:"
    r"|\b(?:m1|m2|c1|seq1|sys|audit|control|fb|access|why|instructor|backup|history|plant)\.[a-z_]+"
    r"|[{}]|\bNone\b|\bTrue\b|0x[0-9A-F]{4}| = "
)
DENIED = {
    "hr": ("Korisnici", "Naprijed", "Usporedba parametara", "Uredi sekvencu"),
    "en": ("Users", "Forward", "Compare parameters", "Edit sequence"),
    "de": ("Benutzer", "Vorwärts", "Parameter vergleichen", "Schrittkette bearbeiten"),
    "cs": ("Uživatelé", "Vpřed", "Porovnání parametrů", "Upravit sekvenci"),
}
"""Pages and a command that somebody was refused."""


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """The demo plant in a folder of its own, which may be edited."""
    folder = tmp_path_factory.mktemp("ordinary")
    copytree(bundled("plants/demo"), folder / "plant")
    with house(Settings(data=folder / "data", plant=folder / "plant")) as browser:
        yield browser


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Iterator[Staff]:
    """A plant in which a morning's work was done through the web, and a backup at the terminal."""
    staff = Staff(demo)
    ana = Operator(staff, "ana", ("admin", "engineer", "operator"))
    runtime = runtime_of(demo)
    assert until(lambda: runtime.tags.sample("m1.f905").seen)
    ivo = staff.add("ivo", "operator")
    staff.have()
    assert staff.post("/signin", {"name": "ivo", "password": "not the one"}).status_code in (401, 403, 422)

    def over() -> None:
        gate = runtime.gate
        assert gate is not None
        assert until(lambda: (last := gate.progress("m1")) is not None and last.over)

    ana.take("m1")
    assert ana.press("/equipment/m1/command/set_frequency", argument="38.5", expected="").status_code < 300
    over()
    assert ana.press("/equipment/m1/command/forward").status_code < 300
    over()
    assert ana.press("/equipment/m1/stop").status_code < 300
    over()
    assert ana.post("/equipment/m1/token/release").status_code == 200
    own = {"own_password": PASSWORD}
    assert ana.post(f"/users/{ivo}/roles", fragment=False, roles="engineer", **own).status_code < 400
    assert ana.post(f"/users/{ivo}/disable", fragment=False, **own).status_code < 400
    Hall(demo).tell("history_quota", percent=83)
    shelved = ana.post("/alarms/shelve", alarm="sys.history_quota", minutes="60", reason="Sensor fault", once="1")
    assert shelved.status_code == 200, shelved.text
    assert ana.post("/instructor/m1/fault", fragment=False, code="4").status_code < 400
    assert ana.post("/instructor/m1/fault", fragment=False, code="0").status_code < 400
    ana.sit()
    digest = re.search(r'name="digest" value="([^"]*)"', staff.client.get("/plant").text)
    ana.post(
        "/plant", fragment=False, digest=digest[1] if digest else "0", read="1"
    )  # nothing has changed: refused, and a line
    ana.sit()
    assert staff.client.get("/audit.csv").status_code == 200
    staff.wait(runtime.recorder.flush)
    assert (
        staff.client.get("/history/export.csv?tags=m1.speed,m1.frequency_setpoint&from=-1m&to=now").status_code == 200
    )
    _force(ana)
    _read_anew(staff, ana)
    viewer = Operator(staff, "vera", ("viewer",))
    assert viewer.get("/users").status_code == 403
    assert viewer.post("/equipment/m1/command/forward").status_code == 403
    assert viewer.get("/equipment/a1/drive-parameters/compare").status_code == 403
    assert viewer.get("/equipment/seq1/definition").status_code == 403
    ana.sit()
    data = runtime.settings.data
    made = CliRunner().invoke(cli, ["backup", str(data.parent / "pogon.backup")], env={"POGON_DATA": str(data)})
    assert made.exit_code == 0, made.output
    ana.sit()
    yield staff


def _force(ana: Operator) -> None:
    """A permissive of a sequence is forced, with reason and password, and released."""
    ana.take("seq1")
    tags = runtime_of(ana.staff.client).tags
    given = {"arg_step": "3", "arg_bit": "1", "reason": "sensor B3 wet", "confirmed": "1", "password": PASSWORD}
    assert ana.press("/equipment/seq1/command/force", arg_duration="3600", **given).status_code < 300
    assert until(lambda: tags.sample("seq1.forces").value == 1)
    assert ana.press("/equipment/seq1/command/release", arg_step="3", arg_bit="1", confirmed="1").status_code < 300
    assert until(lambda: tags.sample("seq1.forces").value == 0)
    assert ana.post("/equipment/seq1/token/release").status_code == 200


def _read_anew(staff: Staff, ana: Operator) -> None:
    """A value in the plant's file is changed, and the file read anew."""
    ana.sit()
    file = runtime_of(staff.client).settings.plant / "plant.toml"
    text = file.read_text("utf-8")
    assert "rated_current = 2.5" in text
    file.write_text(text.replace("rated_current = 2.5", "rated_current = 2.6", 1), "utf-8")
    digest = re.search(r'name="digest" value="([^"]*)"', staff.client.get("/plant").text)
    assert digest
    assert ana.post("/plant", fragment=False, digest=digest[1], read="1").status_code < 400


@pytest.mark.sweep(8)
@pytest.mark.parametrize("lang", LANGUAGES)
def test_no_cell_has_an_id_a_key_or_an_object(staff: Staff, lang: str) -> None:
    staff.client.cookies.set("pogon_lang", lang)
    text = unescape(staff.client.get("/audit").text)
    rows = re.findall(r"<tr[^>]*>(<td class=\"r num dim\">.*?)</tr>", text, re.DOTALL)
    assert len(rows) >= 34
    cells = [
        " ".join(re.sub(r"<[^>]+>", " ", re.sub(r'<small class="mono">.*?</small>', "", cell)).split())
        for row in rows
        for cell in re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row, re.DOTALL)
    ]
    assert not [cell for cell in cells if RAW.search(cell)]
    users, *of_machines = DENIED[lang]
    assert users in cells
    for page in of_machines:
        assert any(re.fullmatch(rf"\S.+: {page}", cell) for cell in cells), page
    assert any(cell == ("38.50 Hz" if lang == "en" else "38,50 Hz") for cell in cells)
