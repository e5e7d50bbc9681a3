"""The page of the encoder adjustment: every step with its state and value, one's own refusals, saving apart; in every language."""

import re
import shutil
from collections.abc import Iterator
from html import unescape
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.settings import Settings
from app.sim.sinamics.drive import VirtualSinamics
from app.sim.sinamics.mailbox import MailboxFault
from app.sim.sinamics.training import REG_MAILBOX
from tests.commands.test_encoder_adjustment import Falls
from tests.virtual import house, pass_time
from tests.web.people import PASSWORD, Staff

PATH = "/equipment/d1/encoder"
HX = {"HX-Request": "true"}


def plant_with_an_axis(folder: Path) -> Path:
    """The bundled plant of two drives; the first one stands and has the basic positioner."""
    shutil.copytree(bundled("plants/sinamics"), folder / "plant")
    file = folder / "plant" / "plant.toml"
    text = file.read_text("utf-8").replace(
        '{ start = "forward", setpoint = 60, p2040 = 1000 }', "{ positioning = 1, setpoint = 60, p2040 = 0 }"
    )
    assert "positioning" in text
    file.write_text(text, "utf-8")
    return folder / "plant"


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    folder = tmp_path_factory.mktemp("axis")
    with house(Settings(plant=plant_with_an_axis(folder), data=folder / "data")) as browser:
        staff = Staff(browser)
        staff.ivana = staff.enter("ivana", "engineer", "operator")  # type: ignore[attr-defined]
        staff.petra = staff.enter("petra", "engineer", "operator")  # type: ignore[attr-defined]
        staff.marko = staff.enter("marko", "operator")  # type: ignore[attr-defined]
        pass_time(3)
        yield staff


@pytest.fixture
def client(people: Staff) -> Iterator[TestClient]:
    """Ivana is in control of d1; nothing was adjusted yet."""
    client = people.client
    for kept in ("encoder_orders", "drive_writing"):
        client.app.state.__dict__.pop(kept, None)  # type: ignore[attr-defined]
    encoders = client.app.state.runtime.gate.encoders  # type: ignore[attr-defined]
    encoders._stories._found.clear()
    encoders._held.clear()
    people.have(people.ivana)  # type: ignore[attr-defined]
    client.cookies.set("pogon_lang", "en")
    people.post("/equipment/d1/token/take", {}, **HX)
    yield client
    drive(client)._to_initial_state()
    people.have(people.ivana)  # type: ignore[attr-defined]
    people.post("/equipment/d1/token/release", {}, **HX)
    pass_time(3)


def drive(client: TestClient) -> VirtualSinamics:
    found = client.app.state.runtime.sim.devices["d1"]  # type: ignore[attr-defined]
    assert isinstance(found, VirtualSinamics)
    return found


def words(text: str) -> str:
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", text))).replace("\u00a0", " ").replace("\u202f", " ")


def post(people: Staff, action: str, status: int = 200, **form: str) -> str:
    answer = people.post(f"{PATH}/{action}", form, **HX)
    assert answer.status_code == status, (answer.status_code, words(answer.text)[:300])
    return str(answer.text)


def order(people: Staff, action: str, seconds: float = 4.0, **form: str) -> str:
    nonce = people.client.get("/nonce").json()["nonce"]
    given = {"id": nonce, "nonce": nonce, "reason": "new encoder", "password": PASSWORD, **form}
    post(people, action, **given)
    pass_time(seconds)
    return parts(people)


def parts(people: Staff) -> str:
    return str(people.client.get(f"{PATH}/parts").text)


def steps(text: str) -> dict[str, tuple[str, str]]:
    """Step → state, words."""
    found = re.findall(r'data-step="(\w+)" data-state="(\w+)"(.*?)</li>', text, re.S)
    return {key: (state, words(rest.partition(">")[2])) for key, state, rest in found}


def part(text: str, name: str) -> str:
    """A part of the page in words, up to the next one."""
    return words(text.partition(f'data-part="d1.enc-{name}"')[2].partition('data-part="d1.enc-')[0].partition(">")[2])


@pytest.mark.sweep(8)
def test_adjusted_step_by_step_then_saved(client: TestClient, people: Staff) -> None:
    assert "Not read yet" in words(client.get(PATH).text)
    post(people, "read")
    pass_time(2)
    text = parts(people)
    assert "Absolute encoder adjustment, state p2507 1 – Not adjusted" in part(text, "held")
    assert {state for state, _ in steps(text).values()} == {"waiting"} and "Start adjustment" in part(text, "go")
    text = order(people, "start", 0.2, coordinate="12 000")
    assert "Cancel" in part(text, "order") and "active" in {state for state, _ in steps(text).values()}
    pass_time(4)
    text = parts(people)
    told = steps(text)
    assert {key: state for key, (state, _) in told.items()} == {
        "read": "done", "coordinate": "done", "start": "done", "wait": "done", "verify": "done", "save": "waiting"
    }  # fmt: skip
    assert "p2599 = 12 000 LU before: 0" in told["coordinate"][1] and "p2507 = 3 – Adjusted" in told["wait"][1]
    assert "r2521 = 12 000 LU" in told["verify"][1] and re.search(r"\d\d:\d\d:\d\d · [\d.]+ s", told["wait"][1])
    assert "12 000 LU" in part(text, "held") and "Adjusted but not saved" in part(text, "order")
    assert "2:p2507" in words(client.get("/equipment/d1/drive-parameters").text)  # unsaved there, too
    text = order(people, "save")
    assert steps(text)["save"][0] == "done" and "Adjusted and saved" in part(text, "order")
    drive(client).model.power_up()
    assert drive(client).model.values("r2521")[0] == 12_000
    assert "Nothing unsaved" in words(client.get("/equipment/d1/drive-parameters").text)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("state", "says", "remedy"),
    [
        (0, "reports an error", "Check encoder"),
        (1, "without adjusting", "absolute encoder"),
        (2, "within 10 s", "OFF1"),
    ],
)
def test_a_failure_names_its_cause_the_remedy_and_what_the_drive_holds(
    client: TestClient, people: Staff, state: int, says: str, remedy: str
) -> None:
    drive(client)._adjustment = Falls(drive(client)._value)
    drive(client)._adjustment.end = state  # type: ignore[attr-defined]
    text = order(people, "start", 18, coordinate="-500")
    told = steps(text)["wait"]
    assert told[0] == "failed" and says in told[1] and remedy in told[1]
    ended = words(text.partition("enc-end")[2].partition("</p>")[0])
    assert ("p2507 0" if state == 0 else "All former values") in ended, ended
    assert "Start adjustment" in part(text, "go") and 'value="-500"' not in text.partition("enc-order")[0]


def test_cancelled_by_whoever_may_and_told_to_everybody(client: TestClient, people: Staff) -> None:
    drive(client)._adjustment = Falls(drive(client)._value)
    drive(client)._adjustment.end = 2  # type: ignore[attr-defined]
    order(people, "start", 2, coordinate="5")
    people.have(people.petra)  # type: ignore[attr-defined]
    client.cookies.set("pogon_lang", "en")
    assert "Cancel" in part(parts(people), "order")
    assert "Control held by" in order(people, "start", 0.5, coordinate="6") or drive(client).model.values("p2599") == [
        5
    ]
    post(people, "cancel")
    pass_time(3)
    told = steps(parts(people))["wait"]
    assert told[0] == "failed" and "Cancelled" in told[1]
    assert drive(client).model.values("p2507") == [1] and drive(client).model.values("p2599") == [0]


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("form", "says"),
    [({"coordinate": "abc"}, "abc"), ({"coordinate": ""}, "Reference point coordinate"), ({"coordinate": "3000000000"}, "2 147 482 647"),
     ({"coordinate": "1", "password": "wrong wrong"}, "password"), ({"coordinate": "1", "password": ""}, "password")],
)  # fmt: skip
def test_what_is_not_right_is_told_and_changes_nothing(
    client: TestClient, people: Staff, form: dict[str, str], says: str
) -> None:
    text = part(order(people, "start", 1.0, **form), "order")
    assert says.casefold() in text.casefold(), text
    assert drive(client).model.values("p2599") == [0]


@pytest.mark.sweep(8)
def test_a_silent_drive_is_told_as_such_and_one_without_positioner_too(client: TestClient, people: Staff) -> None:
    drive(client).write(6, REG_MAILBOX, [MailboxFault.NEVER])
    pass_time(0.5)
    post(people, "read")
    assert "Reading" in part(parts(people), "held")
    pass_time(60)
    assert "answer" in part(parts(people), "order")
    drive(client).write(6, REG_MAILBOX, [0])
    people.post("/equipment/d2/encoder/read", {}, **HX)
    pass_time(2)
    assert "no basic positioner" in words(client.get("/equipment/d2/encoder").text)


def test_only_engineers_and_only_machines_with_an_encoder(client: TestClient, people: Staff) -> None:
    people.have(people.marko)  # type: ignore[attr-defined]
    assert client.get(PATH).status_code == 403
    assert people.post(f"{PATH}/start", {"coordinate": "1"}, **HX).status_code == 403
    assert "/encoder" not in client.get("/equipment/d1/page/words").text
    people.have(people.ivana)  # type: ignore[attr-defined]
    assert "/encoder" in client.get("/equipment/d1/page/words").text
    assert "/encoder" in client.get("/equipment/d1/parameters").text
    assert client.get("/equipment/nothing/encoder").status_code == 404


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("lang", "title"),
    [("hr", "Podesi apsolutni enkoder"), ("de", "Absolutwertgeber justieren"), ("cs", "Nastavit absolutní snímač")],
)
def test_the_page_speaks_every_language(client: TestClient, people: Staff, lang: str, title: str) -> None:
    client.cookies.set("pogon_lang", lang)
    text = words(client.get(PATH).text)
    assert title in text and "enc." not in text and "{" not in part(client.get(PATH).text, "steps")
