"""Filters of the alarm list are kept for each person under a name."""

import html

import pytest
from fastapi.testclient import TestClient

from tests.web.operating import Operator
from tests.web.people import Staff


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Staff:
    demo.pass_time(2)
    return Staff(demo)


@pytest.mark.sweep(8)
def test_a_filter_is_kept_under_a_name_chosen_again_and_forgotten(staff: Staff) -> None:
    ana, iva = (Operator(staff, name, ("operator",)) for name in ("ana", "iva"))
    answer = ana.post("/alarms/filters", kept_as=" Night  shift ", tab="journal", priority="2", source="m1", q="")
    address = "/alarms?tab=journal&priority=2&source=m1"
    assert (answer.status_code, answer.headers["hx-redirect"]) == (204, address)
    page = html.unescape(ana.get("/alarms", fragment=False).text)
    assert f'href="{address}"' in page and ">Night shift</a>" in page
    assert ana.get(address, fragment=False).status_code == 200
    assert ">Night shift</a>" not in iva.get("/alarms", fragment=False).text
    ana.post("/alarms/filters/forget", kept_as="Night shift")
    assert ">Night shift</a>" not in ana.get("/alarms", fragment=False).text


@pytest.mark.sweep(8)
def test_what_is_no_filter_is_refused(staff: Staff) -> None:
    ana = Operator(staff, "ana", ("operator",))
    for given in ({"tab": "journal"}, {"priority": "9"}, {"tab": "elsewhere"}, {"state": "none"}):
        assert ana.post("/alarms/filters", kept_as="x", **given).status_code == 422, given
    assert ana.post("/alarms/filters", kept_as=" ", priority="2").status_code == 422
    staff.have()
    assert 'id="a-kept-as"' not in staff.client.get("/alarms").text, "a guest keeps nothing"
