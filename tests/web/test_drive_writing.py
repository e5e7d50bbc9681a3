"""The list of new values: chosen, reviewed against the drive, written by the gate, saved apart; and the same in every language."""

import re
from collections.abc import Iterator
from html import unescape

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.plant.plant_files.languages import LANGUAGES
from app.settings import Settings
from app.sim.sinamics.drive import VirtualSinamics
from app.sim.sinamics.mailbox import MailboxFault
from app.sim.sinamics.training import REG_MAILBOX
from tests.virtual import house, pass_time
from tests.web.people import PASSWORD, Staff

PATH = "/equipment/d2/drive-parameters"
HX = {"HX-Request": "true"}


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    settings = Settings(plant=bundled("plants/sinamics"), data=tmp_path_factory.mktemp("drives") / "data")
    with house(settings) as browser:
        staff = Staff(browser)
        staff.ivana = staff.enter("ivana", "engineer", "operator")  # type: ignore[attr-defined]
        pass_time(3)
        yield staff


@pytest.fixture
def client(people: Staff) -> Iterator[TestClient]:
    """Ivana is in control of d2, her list is empty, the mailbox is right."""
    client = people.client
    client.app.state.__dict__.pop("drive_writing", None)  # type: ignore[attr-defined]
    people.have(people.ivana)  # type: ignore[attr-defined]
    client.cookies.set("pogon_lang", "en")
    people.post("/equipment/d2/token/take", {}, **HX)
    yield client
    drive(client)._to_initial_state()
    drive(client).write(6, REG_MAILBOX, [0])
    people.have(people.ivana)  # type: ignore[attr-defined]
    people.post("/equipment/d2/token/release", {}, **HX)
    pass_time(3)


def drive(client: TestClient) -> VirtualSinamics:
    found = client.app.state.runtime.sim.devices["d2"]  # type: ignore[attr-defined]
    assert isinstance(found, VirtualSinamics)
    return found


def words(text: str) -> str:
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", text))).replace("\u00a0", " ").replace("\u202f", " ")


def post(people: Staff, action: str, **form: object) -> str:
    answer = people.post(f"{PATH}/{action}", form, **HX)
    assert answer.status_code == 200, (answer.status_code, words(answer.text)[:300])
    return str(answer.text)


def reviewed(people: Staff, typed: dict[str, str], seconds: float = 3.0) -> str:
    """Fill the list and have it reviewed."""
    for key in typed:
        post(people, "list", add=key)
    post(people, "review", key=list(typed), value=list(typed.values()))
    pass_time(seconds)
    return str(people.client.get(f"{PATH}/list").text)


def ordered(people: Staff, action: str, seconds: float = 5.0, **form: str) -> str:
    nonce = people.client.get("/nonce").json()["nonce"]
    given = {"id": nonce, "nonce": nonce, "reason": "trial", "password": PASSWORD, **form}
    text = post(people, action, **given)
    if "hx-trigger" in text.partition("<p")[0]:
        pass_time(seconds)
        text = str(people.client.get(f"{PATH}/list").text)
    return text


def lines(text: str, kind: str = "element") -> dict[str, str]:
    """Element → what its line says, of the list, its review, or (`result`) of what became of it."""
    found = re.findall(rf'<li class="rv[^"]*" data-{kind}="([^"]+)"(.*?)</li>', text, re.S)
    return {key: words(row) for key, row in found}


@pytest.mark.sweep(8)
def test_reviewed_written_read_back_and_saved(client: TestClient, people: Staff) -> None:
    text = reviewed(people, {"1:p1120": "7.5", "1:p0757[2]": "-1.25", "1:p1300": "21", "1:p0840": "r0722.3"})
    rows = lines(text)
    assert "5 7.5 s" in rows["1:p1120"] and "0 … 650 s" in rows["1:p1120"], rows
    assert "20 – Speed control without encoder 21 – Speed control with encoder" in rows["1:p1300"]
    assert "0 r0722.3" in rows["1:p0840"] and "0 −1.25 V" in rows["1:p0757[2]"]
    assert 'type="password"' in text and "All values or none" in words(text)
    text = ordered(people, "write")
    assert {key: "Written and read back" in row for key, row in lines(text, "result").items()} == dict.fromkeys(
        rows, True
    ), words(text)
    model = drive(client).model
    assert model.values("p1120") == [7.5] and model.values("p0757")[2] == -1.25 and model.values("p1300") == [21]
    assert model.values("p0840") == [722 << 16 | 63 << 10 | 3]
    assert "Unsaved changes: 4" in words(text)
    page = words(client.get(PATH).text)
    assert "Unsaved changes: 4" in page
    text = ordered(people, "save")
    assert "→ Done" in words(text) and "Nothing unsaved" in words(text), words(text)
    model.power_up()
    assert model.values("p1120") == [7.5]
    trail = people.wait(people.access.audit.find, _filter("d2.drive"), 10)
    assert [(line.kind, line.result) for line in reversed(trail)][-4:] == [
        ("command.sent", "sent"), ("command", "confirmed"), ("command.sent", "sent"), ("command", "confirmed"),
    ]  # fmt: skip
    assert "7.5" in trail[-1].new or "7.5" in trail[2].new


def _filter(object: str) -> object:
    from app.access.audit.search import Filter

    return Filter(object=object)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("key", "typed", "says"),
    [
        ("1:p1120", "651", "Permitted: 0 to 650 s"),
        ("1:p1120", "fast", "Not a number"),
        ("1:p1120", "", "Required field"),
        ("1:p1300", "20.5", "Too many decimal places"),
        ("1:p0840", "9", "Not a source"),
        ("1:p0922", "2", "Not one of the permitted choices"),
    ],
)
def test_what_cannot_be_written_is_told_before_it_is_sent(
    client: TestClient, people: Staff, key: str, typed: str, says: str
) -> None:
    text = reviewed(people, {key: typed})
    assert (
        says in lines(text)[key]
        and "Cannot be written: 1" in words(text)
        and 'type="password"' not in text.partition("dw-save")[0]
    )
    answer = people.post(f"{PATH}/write", {"reason": "x"}, **HX)
    assert answer.status_code == 422


@pytest.mark.sweep(8)
def test_what_the_drive_refuses_is_told_by_its_error_and_all_is_put_back(client: TestClient, people: Staff) -> None:
    reviewed(people, {"1:p1120": "9", "1:p0304": "230"})
    text = ordered(people, "write")
    assert "Only during commissioning (p0010 not 0)" in lines(text, "result")["1:p0304"]
    assert "Former value is in the device" in lines(text, "result")["1:p1120"]
    assert "All former values are in the device" in words(text) and "p0304: Only during commissioning" in words(text)
    assert "0x75" in words(text) and drive(client).model.values("p1120") == [5.0]
    assert "Unsaved changes" not in words(text) and 'value="9"' in text  # the list is still there to be corrected


@pytest.mark.sweep(8)
def test_reason_password_and_control_are_asked_for(client: TestClient, people: Staff) -> None:
    reviewed(people, {"1:p1120": "9"})
    assert "Enter a reason" in words(ordered(people, "write", reason=""))
    assert "Enter password again" in words(ordered(people, "write", password=""))
    assert drive(client).model.values("p1120") == [5.0]
    wrong = words(ordered(people, "write", password="nothing like it"))
    assert "password" in wrong.lower() and drive(client).model.values("p1120") == [5.0]
    people.post("/equipment/d2/token/release", {}, **HX)
    assert "Take control first" in words(ordered(people, "write"))


@pytest.mark.sweep(8)
def test_a_list_is_its_persons_own_and_the_value_must_still_be_as_it_was_seen(
    client: TestClient, people: Staff
) -> None:
    reviewed(people, {"1:p1120": "9"})
    drive(client).model._shared["p1120"] = 6.0
    text = ordered(people, "write")
    assert "Changed meanwhile: now 6 s" in words(text) and drive(client).model.values("p1120") == [6.0]
    people.enter("petra", "engineer", "operator")
    client.cookies.set("pogon_lang", "en")
    assert "No changes yet" in words(client.get(f"{PATH}/list").text)


@pytest.mark.sweep(8)
def test_a_silent_drive_is_told_in_the_review(client: TestClient, people: Staff) -> None:
    drive(client).write(6, REG_MAILBOX, [MailboxFault.NEVER])
    pass_time(1)
    text = reviewed(people, {"1:p1120": "9"}, seconds=20)
    assert "No answer from the device" in words(text) and 'value="9"' in text
    drive(client).write(6, REG_MAILBOX, [MailboxFault.INTERNAL])
    pass_time(3)
    post(people, "review")
    pass_time(3)
    assert "Parameter mailbox: internal error" in words(client.get(f"{PATH}/list").text)


@pytest.mark.sweep(8)
def test_while_it_writes_it_says_how_far_it_is_and_can_be_cancelled(client: TestClient, people: Staff) -> None:
    typed = {f"1:p0758[{n}]": "5" for n in range(4)} | {f"1:p2024[{n}]": "9" for n in range(3)} | {"1:p1120": "8"}
    reviewed(people, typed)
    drive(client).write(6, REG_MAILBOX, [MailboxFault.LATE])
    nonce = client.get("/nonce").json()["nonce"]
    text = post(people, "write", id=nonce, nonce=nonce, reason="x", password=PASSWORD)
    assert 'hx-trigger="every 500ms"' in text and "Reading" in words(text)
    assert people.post(f"{PATH}/list", {"clear": "1"}, **HX).status_code == 409
    post(people, "cancel")
    pass_time(30)
    text = words(client.get(f"{PATH}/list").text)
    assert "Cancelled" in text and "All former values are in the device" in text, text
    assert drive(client).model.values("p1120") == [5.0]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("language", LANGUAGES)
def test_it_is_told_in_every_language(client: TestClient, people: Staff, language: str) -> None:
    client.cookies.set("pogon_lang", language)
    text = reviewed(people, {"1:p1120": "9", "1:p0304": "230", "1:p1300": "21"}) + client.get(PATH).text
    text += ordered(people, "write")
    assert not re.search(r"\[(?:[a-z]{2}\]|[a-z_]+(?:\.[a-z0-9_]+)+\])", words(text)), words(text)


class _OneMore(list):  # type: ignore[type-arg]
    """An element that takes every value as one more."""

    def __setitem__(self, at: object, values: object) -> None:
        super().__setitem__(at, [one + 1 for one in values])  # type: ignore


@pytest.mark.sweep(8)
def test_values_that_nobody_chose_are_an_alarm_that_names_them(client: TestClient, people: Staff) -> None:
    ram = drive(client).model._ram
    ram["p1058"] = _OneMore(ram["p1058"])
    reviewed(people, {"1:p1120": "9", "1:p1058": "90"})
    text = words(ordered(people, "write"))
    assert "Mixed values: p1120 5.000 s (former), p1058 151.000 rpm (other)" in text and "Unsaved changes: 1" in text
    page = words(client.get("/alarms").text)
    assert "Values written in part: p1120 = 5.000 s (former), p1058 = 151.000 rpm (other)" in page


def test_only_engineers_and_only_elements_that_there_are(client: TestClient, people: Staff) -> None:
    for wrong in ("1:r0020", "1:p9999", "1:p1120[0]", "1:p0757", "1:p0757[4]", "x", "300:p1120", "1:p1120 "):
        assert people.post(f"{PATH}/list", {"add": wrong}, **HX).status_code == 422, wrong
    people.enter("marko", "operator")
    for action in ("list", "review", "write", "save", "cancel"):
        assert people.post(f"{PATH}/{action}", {}, **HX).status_code == 403
