"""Shelving and service as browsers ask for them: who may, what is refused, what is said and written, and the list of what is hidden."""

from collections.abc import Iterator
from html import unescape
from typing import Any

import pytest

from app.access.audit.search import Filter
from app.errors import StorageError
from app.plant.alarm_class import AlarmClass
from app.settings import Settings
from tests import virtual
from tests.web.test_alarms import LANGUAGES, Hall, rows

ALARM = "sys.history_quota"
SHELVE = {"alarm": ALARM, "minutes": "60", "reason": "Sensor fault"}
OUT = {"alarm": ALARM, "reason": "Maintenance", "more": "rack open", "permit": "P-17"}
ASKED: dict[str, dict[str, str]] = {
    "shelve": SHELVE,
    "unshelve": {"alarm": ALARM},
    "take-out": OUT,
    "review": {"alarm": ALARM},
    "put-back": {"alarm": ALARM},
}
MAY = {action: ("operator", "engineer") if "shelve" in action else ("engineer",) for action in ASKED}


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hall]:
    with virtual.house(Settings(data=tmp_path_factory.mktemp("hiding") / "data")) as client:
        yield Hall(client)


def ask(hall: Hall, action: str, fields: dict[str, str] | None = None) -> Any:
    hall.client.cookies.set("pogon_lang", "en")
    return hall.staff.post(f"/alarms/{action}", ASKED[action] if fields is None else fields, **{"HX-Request": "true"})


@pytest.mark.parametrize("role", ["viewer", "admin", "operator", "engineer"])
def test_each_role_may_what_the_table_of_permissions_says(hall: Hall, role: str) -> None:
    hall.tell("history_quota", percent=83)
    hall.staff.enter(f"r_{role}", role)
    for action in ASKED:
        answer = ask(hall, action)
        assert (answer.status_code == 200) is (role in MAY[action]), (role, action, answer.status_code)
        if role not in MAY[action]:
            assert answer.status_code == 403
    assert not hall.staff.wait(hall.engine.list.hidden), "put aside and brought back, or never put aside"


def test_who_shelved_it_why_and_until_when_is_on_the_list_in_every_language(hall: Hall) -> None:
    hall.tell("history_quota", percent=83)
    hall.staff.enter("ana", "operator")
    answer = ask(hall, "shelve")
    assert "Shelved: Server: history storage 83 % full" in unescape(answer.text)
    assert ALARM not in rows(hall.page("/alarms"))
    for lang, word in zip(LANGUAGES, ("Odgođeno od", "Shelved", "Zurückgestellt", "Odloženo od"), strict=True):
        html = unescape(hall.page("/alarms?tab=hidden", lang))
        assert rows(html) == [ALARM] and word in html and "ana. Sensor fault" in html, lang
    assert 'data-tag="sys.alarms.hidden"' in hall.page("/"), "every page counts them"
    assert "Shelved" in hall.page("/alarms?tab=journal&event=SHELVED")
    lines = hall.staff.wait(hall.staff.access.audit.find, Filter(kind="alarm", person="ana"), 5)
    assert (lines[0].object, lines[0].new) == (ALARM, "60 min")
    hall.staff.have()
    assert "Sensor fault" not in hall.page("/alarms?tab=hidden"), "a visitor reads no names and no words of people"
    hall.staff.enter("ana", "operator")
    assert "Unshelved:" in ask(hall, "unshelve").text
    assert ALARM in rows(hall.page("/alarms"))


@pytest.mark.parametrize(
    ("action", "change", "status"),
    [
        ("shelve", {"minutes": "x"}, 422),
        ("shelve", {"minutes": "721"}, 422),
        ("shelve", {"minutes": "0"}, 422),
        ("shelve", {"reason": ""}, 422),
        ("shelve", {"once": "2"}, 422),
        ("shelve", {"extra": "1"}, 422),
        ("shelve", {"alarm": "nothing"}, 404),
        ("shelve", {"alarm": "sys.audit_broken"}, 403),
        ("unshelve", {}, 409),
    ],
)
def test_what_makes_no_sense_is_refused_and_changes_nothing(
    hall: Hall, action: str, change: dict[str, str], status: int
) -> None:
    hall.tell("history_quota", percent=83)
    hall.tell("audit_broken")
    hall.staff.enter("ana", "operator")
    assert ask(hall, action, ASKED[action] | change).status_code == status
    assert not hall.staff.wait(hall.engine.list.hidden)


def test_the_detail_offers_what_one_may(hall: Hall) -> None:
    hall.tell("history_quota", percent=83)
    path = f"/alarms/detail/{hall.one(ALARM).occurrence}"
    for role, shelves, takes in (("viewer", 0, 0), ("operator", 1, 0), ("engineer", 1, 1)):
        hall.staff.enter(f"d_{role}", role)
        html = hall.page(path)
        assert (html.count('form="alarm-shelve" data-put'), html.count('form="alarm-take-out" data-put')) == (
            shelves,
            takes,
        )


def test_the_dialog_offers_what_the_class_allows_and_the_server_refuses_the_rest(hall: Hall) -> None:
    hall.tell("history_quota", percent=83)
    hall.staff.enter("ema", "engineer", "operator")
    number = next(one.occurrence for one in hall.engine.list.active() if one.id == ALARM)

    def dialog() -> str:
        return str(hall.client.get(f"/alarms/detail/{number}", headers={"HX-Request": "true"}).text)

    detail = dialog()
    assert [minutes in detail for minutes in ('value="15"', 'value="720"', 'form="alarm-take-out"')] == [True] * 3
    before, hiding = hall.engine.hiding.classes, hall.engine.hiding
    try:
        hiding.classes = {"system": AlarmClass(90 * 60.0, out_of_service=False, reason=False)}
        detail = dialog()
        spans = [minutes for minutes in (15, 60, 90, 240, 720) if f'<option value="{minutes}">' in detail]
        assert spans == [15, 60, 90] and 'form="alarm-take-out"' not in detail
        assert "<option></option>" in detail, "a reason may be left out"
        long = ask(hall, "shelve", SHELVE | {"minutes": "240"})
        assert long.status_code == 422 and "90 min" in unescape(long.text)
        out = ask(hall, "take-out")
        assert out.status_code == 409 and "not taken out of service in this plant" in unescape(out.text)
        assert ask(hall, "shelve", {"alarm": ALARM, "minutes": "90"}).status_code == 200
        assert ask(hall, "unshelve").status_code == 200
        hiding.classes = {"system": AlarmClass(0.0)}
        detail = dialog()
        assert 'form="alarm-shelve"' not in detail and 'form="alarm-take-out"' in detail
        assert ask(hall, "shelve").status_code == 409
    finally:
        hiding.classes = before


UNSTORED = ("Još nije spremljeno", "Not stored yet", "Noch nicht gespeichert", "Zatím neuloženo")


def test_nothing_that_the_disk_did_not_take_is_told_as_done_without_a_word(
    hall: Hall, monkeypatch: pytest.MonkeyPatch
) -> None:
    hall.tell("history_quota", percent=83)
    hall.staff.enter("eva", "engineer", "operator")
    monkeypatch.setattr(hall.engine.journal, "_db", Full())
    for action in ("shelve", "unshelve", "take-out", "review", "put-back"):
        for lang, words in zip(LANGUAGES, UNSTORED, strict=True) if action == "review" else [("en", "Not stored yet")]:
            hall.client.cookies.set("pogon_lang", lang)
            answer = hall.staff.post(f"/alarms/{action}", ASKED[action], **{"HX-Request": "true"})
            assert answer.status_code == 200 and 'data-kind="error"' in answer.text, (action, answer.text)
            assert words in unescape(answer.text), (action, answer.text)
    occurrence = hall.one(ALARM).occurrence
    hall.client.cookies.set("pogon_lang", "en")
    for words in ("1 alarm acknowledged. Not stored yet", "1 alarm acknowledged. Not stored yet"):
        assert words in unescape(hall.acknowledge(occurrence).text), "a second press is told the same"
    monkeypatch.undo()
    assert "Shelved: " in (answer := unescape(ask(hall, "shelve").text)) and "Not stored" not in answer
    assert "Unshelved: " in unescape(ask(hall, "unshelve").text)
    assert hall.staff.wait(hall.engine.journal.verify).ok


class Full:
    """A database on a full disk."""

    async def write(self, work: object) -> object:
        raise StorageError("database or disk is full")
