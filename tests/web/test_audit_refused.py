"""What is refused at the door stands in the audit with what was asked for, by whom, and the role that it needs; many are few lines."""

from html import unescape

import pytest
from fastapi.testclient import TestClient

from app.access.audit.search import Filter
from tests.web.people import Staff

REFUSED = {
    "/equipment/m1/stop": ("m1", "stop", ""),
    "/equipment/m1/command/forward": ("m1", "forward", ""),
    "/equipment/m2/command/forward": ("m2", "forward", ""),
    "/equipment/m1/command/reverse": ("m1", "reverse", ""),
    "/equipment/m1/setpoint/f114": ("m1", "f114", ""),
    "/equipment/m1/token/take": ("m1", "", "take"),
    "/equipment/m1/token/release": ("m1", "", "release"),
    "/equipment/m1/hold/jog_forward": ("m1", "jog_forward", ""),
    "/equipment/m1/command/nonsense": ("m1", "", ""),
}


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Staff:
    return Staff(demo)


@pytest.mark.sweep(8)
def test_of_what_is_refused_at_the_door_the_line_says_what_and_why(staff: Staff) -> None:
    """A Stop, a setpoint and the control of one machine were one and the same line."""
    csrf = staff.enter("vera", "viewer")
    for path in REFUSED:
        for _ in range(2):
            assert staff.client.post(path, data={"csrf": csrf}).status_code == 403, path
    staff.enter("ana", "engineer", "admin")
    runtime = staff.client.app.state.runtime  # type: ignore[attr-defined]
    texts = runtime.texts
    for lang in ("hr", "en", "de", "cs"):
        staff.client.cookies.set("pogon_lang", lang)
        page = unescape(staff.client.get("/audit", params={"person": "vera"}).text)
        told = []
        for machine, key, control in REFUSED.values():
            item = runtime.plant.equipment[machine]
            kind = item.type
            label = kind.commands[key].label if key in kind.commands else item.points[key].label if key else ""
            what = (
                texts.of_type(lang, kind, label)
                if label
                else texts.text(lang, f"control.{control}" if control else "frame.commands")
            )
            told.append(f"<td>{texts.label(lang, item.label)}: {what}</td>")
        assert len(set(told)) == len(REFUSED)
        assert [page.count(one) for one in told] == [1] * len(REFUSED), lang
        needed = " / ".join(texts.text(lang, f"access.role.{role}") for role in ("operator", "engineer"))
        assert page.count(f"<small>{texts.text(lang, 'audit.needs', roles=needed)}</small>") >= len(REFUSED), lang


@pytest.mark.sweep(8)
def test_who_asks_for_everything_fills_no_audit(staff: Staff) -> None:
    csrf = staff.enter("vid", "viewer")
    runtime = staff.client.app.state.runtime  # type: ignore[attr-defined]
    asked = [
        f"/equipment/{item.id}/command/{key}" for item in runtime.plant.equipment.values() for key in item.type.commands
    ]
    assert len(asked) > 60
    for path in asked:
        staff.client.post(path, data={"csrf": csrf})
    staff.enter("ana", "engineer", "admin")
    lines = staff.wait(staff.access.audit.find, Filter(person="vid", kind="access.denied"), 1000)
    assert len(lines) == 31 and "command" not in lines[0].parameters
