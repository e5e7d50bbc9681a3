"""What ordinary use writes into the audit is read by a plant manager: no id, key, object or empty value of ours in any cell."""

import re
from collections.abc import Iterator
from html import unescape

import pytest
from fastapi.testclient import TestClient

from tests.web.operating import Operator, runtime_of, until
from tests.web.people import PASSWORD, Staff
from tests.web.test_alarms import LANGUAGES, Hall

RAW = re.compile(
    r"/plants/|one-shot|terminal:|\b(?:m1|m2|sys|audit|control|fb|access|why|instructor)\.[a-z_]+|[{}]|\bNone\b|\bTrue\b|0x[0-9A-F]{4}| = "
)


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Iterator[Staff]:
    """A plant in which a morning's work was done through the web."""
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
    yield staff


@pytest.mark.parametrize("lang", LANGUAGES)
def test_no_cell_has_an_id_a_key_or_an_object(staff: Staff, lang: str) -> None:
    staff.client.cookies.set("pogon_lang", lang)
    page = unescape(staff.client.get("/audit").text)
    rows = re.findall(r"<tr[^>]*>(<td class=\"r num dim\">.*?)</tr>", page, re.DOTALL)
    assert len(rows) >= 22
    cells = [
        " ".join(re.sub(r"<[^>]+>", " ", re.sub(r'<small class="mono">.*?</small>', "", cell)).split())
        for row in rows
        for cell in re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row, re.DOTALL)
    ]
    assert not [cell for cell in cells if RAW.search(cell)]
    assert any(cell == ("38.50 Hz" if lang == "en" else "38,50 Hz") for cell in cells)
