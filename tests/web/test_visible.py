"""Who reads what: values by name as on their pages, no names for visitors, figures for Prometheus, errors in the description."""

import json
import re
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families

from app.access.roles import Person, permissions_of
from app.main import create_app
from app.plant.record_kinds import former_addresses
from app.plant.types import EQUIPMENT
from app.running.page_tags import page_tags
from app.settings import Settings
from app.web.guard import permission_of_point, permissions
from tests.web.knock import knock
from tests.web.people import HOST, Staff


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    app = create_app(Settings(data=tmp_path_factory.mktemp("visible") / "data"))
    with TestClient(app, base_url=HOST, follow_redirects=False, client=("127.0.0.1", 50000)) as client:
        yield Staff(client)


def runtime(staff: Staff) -> Any:
    return staff.client.app.state.runtime  # type: ignore[attr-defined]


def guarded(staff: Staff) -> list[str]:
    return [name for name, point in runtime(staff).points.items() if permission_of_point(point) != "view"]


def hello(staff: Staff, *names: str) -> dict[str, Any]:
    with staff.client.websocket_connect("ws://127.0.0.1:8000/live", headers={"Origin": HOST}) as socket:
        socket.send_json({"subscribe": f"tags/{','.join(names)}", "rev": 0})
        answer: dict[str, Any] = socket.receive_json()
        return answer.get("hello", answer)  # type: ignore[no-any-return]


# ---- values by name ---------------------------------------------------------------------------------------


def test_what_everybody_follows_is_not_guarded_and_links_history_and_parameters_are(staff: Staff) -> None:
    found = set(guarded(staff))
    everybody = {
        "m1.speed",
        "m1.frequency_setpoint",
        "sys.loop_lag",
        "sys.commands.m1",
        "sys.alarms.total",
        "sys.alarms.revision",
    }
    assert not everybody & found
    assert {"m1.f114", "sys.link.hall.polls", "sys.link.hall.state", "sys.history.fill"} <= found
    assert not [name for name in page_tags("overview", runtime(staff).plant, runtime(staff).points) if name in found]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("who", ["guest", "viewer"])
def test_no_road_gives_a_guarded_value_to_who_may_not_open_its_page(staff: Staff, who: str) -> None:
    staff.have()
    if who != "guest":
        staff.enter("eva", "viewer")
    found = guarded(staff)
    listed = {one["name"] for one in staff.client.get("/api/v1/tags?prefix=sys.").json()}
    assert listed
    assert not listed & set(found)
    for name in found[::7]:
        roads = [f"/api/v1/tags/{name}", f"/api/v1/tags?names=m1.speed,{name}", f"/history/series?tags={name}",
                 f"/trends/table?tags={name}&from=-1h", f"/trends/marks?tags={name}&from=-1h", f"/trends/recent?tags=m1.speed,{name}",
                 f"/trends?tags={name}", f"/api/v1/history?tags={name}&from=2026-01-01T00:00:00Z&to=2026-01-02T00:00:00Z"]  # fmt: skip
        if who == "viewer":
            roads += [
                f"/history/export.csv?tags={name}",
                f"/api/v1/history/{name}/raw?from=2026-01-01T00:00:00Z&to=2026-01-02T00:00:00Z",
            ]
        for road in roads:
            assert (road, staff.client.get(road).status_code) == (road, 403)
        assert hello(staff, name) == {"error": "not_allowed"}
        mixed = hello(staff, "m1.speed", name)
        assert mixed["denied"] == [name]
        assert name not in mixed["handles"]


@pytest.mark.sweep(8)
def test_who_may_diagnose_reads_them(staff: Staff) -> None:
    staff.enter("ana", "operator")
    for name in guarded(staff)[::7]:
        assert staff.client.get(f"/api/v1/tags/{name}").status_code == 200
        answer = hello(staff, name)
        assert name in answer["handles"]
        assert "denied" not in answer


def test_a_token_reads_the_settings_that_it_may_write_once_it_may_diagnose(staff: Staff) -> None:
    """It could write each of them and read none: no token could be given the right."""
    key = staff.add("fitter", "engineer")
    may = permissions_of({"engineer"})
    maker = Person(key, "fitter", "", frozenset({"engineer"}), may, "")
    staff.have()
    for granted, status in ((["view", "configure"], 403), (["view", "configure", "diagnose"], 200)):
        _, secret = staff.wait(staff.access.tokens.create, maker, "MES", granted, 7)
        bearer = {"Authorization": f"Bearer {secret}"}
        for name in ("m1.f114", "c1.jerk", "sys.link.hall.state"):
            answer = staff.client.get(f"/api/v1/tags/{name}", headers=bearer)
            assert (name, answer.status_code) == (name, status)


def test_names_that_nobody_knows_are_told_and_too_many_are_too(staff: Staff) -> None:
    staff.enter("ana", "operator")
    answer = hello(staff, "m1.speed", "m1.sped", "č", "m9.speed")
    assert answer["unknown"] == ["m1.sped", "č", "m9.speed"]
    assert "m1.speed" in answer["handles"]
    assert "unknown" not in hello(staff, "m1.speed", "m1.speed")
    assert hello(staff, *(f"x{number}" for number in range(201))) == {"error": "too_many_tags"}
    assert len(hello(staff, *(f"x{number}" for number in range(200)))["unknown"]) == 200


# ---- pages ------------------------------------------------------------------------------------------------


@pytest.mark.sweep(8)
@pytest.mark.parametrize("roles", [(), ("viewer",), ("operator",)])
def test_whoever_may_open_a_page_may_follow_it(staff: Staff, roles: tuple[str, ...]) -> None:
    """Else it would say for ever that the server is gone. All pages that a person comes to from the overview by what is pressed."""
    staff.have()
    if roles:
        staff.enter(f"who-{roles[0]}", *roles)
    ahead, seen, silent = ["/"], set(), []
    while ahead:
        path = ahead.pop()
        seen.add(path)
        answer = staff.client.get(path)
        if answer.status_code != 200 or "text/html" not in answer.headers["content-type"]:
            continue
        kind = re.search(r'<body data-page="([^"]*)"[^>]* data-live=', answer.text)
        if kind and "hello" not in follow(staff, kind[1]):
            silent.append((path, kind[1]))
        found = (one.split("?")[0].split("#")[0] for one in re.findall(r'<a[^>]* href="(/[^"]*)"', answer.text))
        ahead += {one for one in found if one not in seen and not one.startswith("/static/") and "export" not in one}
    assert len(seen) > 40
    assert "/equipment/a1/fault-buffer" in seen
    assert silent == []


def follow(staff: Staff, kind: str) -> dict[str, Any]:
    """What the server says to a page of this kind that asks for its values."""
    with staff.client.websocket_connect("ws://127.0.0.1:8000/live", headers={"Origin": HOST}) as socket:
        socket.send_json({"subscribe": kind, "rev": 0})
        return socket.receive_json()  # type: ignore[no-any-return]


# ---- names of people --------------------------------------------------------------------------------------


@pytest.mark.sweep(8)
def test_no_page_tells_a_visitor_who_anybody_is(staff: Staff) -> None:
    display = "Zvonimira Horvatinčić"
    staff.add("zvonimira", "operator", "engineer")
    staff.wait(staff.access.people.rename, _boss(), staff._ids["zvonimira"], display)
    staff.enter("zvonimira")
    for _ in range(2):
        assert staff.post("/equipment/m1/token/take").status_code in (200, 303)
        staff.post("/equipment/m1/stop", {"id": "visible-1"})
    told = staff.client.get("/api/v1/equipment/m1/commands").text
    assert "zvonimira" in told.lower()
    staff.have()
    for route in permissions(staff.client.app):  # type: ignore[arg-type]
        method, path = route.split()
        if method != "GET" or path.startswith("/static"):
            continue
        for key in ("m1", "m2"):
            address = re.sub(r"\{key\}", key, path)
            address = re.sub(r"\{command\}", "forward", re.sub(r"\{name\}", "m1.speed", address))
            answer = knock(staff.client, "GET", re.sub(r"\{[^}]*\}", "1", address), query="from=-1h")
            assert b"zvonimira" not in answer.body.lower(), address


@pytest.mark.sweep(8)
def test_an_alarm_about_an_account_tells_a_visitor_not_whose(staff: Staff) -> None:
    """Wrong passwords would tell a stranger which names are right, and the first alarm of a plant who its administrator is."""
    staff.add("ljudevita", "admin")
    staff.wait(staff.access.throttle.clear, "ljudevita")
    for _ in range(6):
        staff.have()
        staff.post("/signin", {"name": "ljudevita", "password": "wrong and wrong again", "next": "/"})
    pages = (
        "/",
        "/alarms",
        "/alarms?tab=journal",
        "/alarms/banner",
        "/alarms/summary",
        "/alarms/list",
        "/api/v1/alarms",
        "/alarms/statistics",
    )
    details = {
        f"/alarms/detail/{one.occurrence}"
        for one in runtime(staff).alarms.list.active()
        if one.id in ("sys.account_locked", "sys.admin_added")
    }
    assert details, "both alarms stand"
    staff.have()
    for page in (*pages, *details):
        answer = staff.client.get(page)
        assert answer.status_code == 200 and "ljudevita" not in answer.text.lower(), page
    staff.enter("vesna", "viewer")
    for page in ("/alarms?tab=journal", "/api/v1/alarms"):
        assert "ljudevita" in staff.client.get(page).text


def _boss() -> Any:
    from tests.web.people import BOSS

    return BOSS


# ---- figures and the description --------------------------------------------------------------------------


def test_figures_have_their_kind(staff: Staff) -> None:
    staff.enter("ana", "operator")
    staff.post("/equipment/m1/stop", {"id": "visible-2"})
    text = staff.client.get("/metrics").text
    families = {family.name: family for family in text_string_to_metric_families(text)}
    for name in (
        "task_failures",
        "link_timeouts",
        "link_exceptions",
        "link_retries",
        "history_dropped_rows",
        "simulation_overruns",
    ):
        assert families[f"pogon_{name}"].type == "counter", name
    for name in (
        "loop_lag_seconds",
        "link_up",
        "alarms",
        "history_rows_per_second",
        "history_full",
        "history_fill_ratio",
        "watchers",
    ):
        assert families[f"pogon_{name}"].type == "gauge", name
    assert {sample.labels["priority"] for sample in families["pogon_alarms"].samples} == {"1", "2", "3", "4"}
    assert {"process_resident_memory_bytes", "process_open_fds", "process_cpu_seconds"} <= set(families)


def test_commands_that_ended_are_counted(staff: Staff) -> None:
    runtime(staff).command_ends.counts["confirmed"] += 3
    families = {one.name: one for one in text_string_to_metric_families(staff.client.get("/metrics").text)}
    assert families["pogon_commands"].type == "counter"
    assert {
        one.labels["state"]: one.value for one in families["pogon_commands"].samples if one.name.endswith("_total")
    }["confirmed"] >= 3


def test_every_road_of_the_interface_says_how_it_refuses(staff: Staff) -> None:
    staff.enter("eng", "engineer")
    schema = json.loads(staff.client.get("/api/v1/openapi.json").text)
    there = {route.split()[1] for route in permissions(staff.client.app) if "/api/v1/" in route}  # type: ignore[arg-type]
    former = {f"/api/v1/{address}" for address in former_addresses(EQUIPMENT)}
    assert former == {path for path in former if staff.client.get(path, follow_redirects=False).status_code == 308}
    assert set(schema["paths"]) == there - {"/api/v1/openapi.json"} - former
    for path, methods in schema["paths"].items():
        for method, operation in methods.items():
            declared = set(operation["responses"])
            assert {"401", "403", "422"} <= declared, path
            if "{" in path:
                assert "404" in declared, path
            if method == "post":
                assert {"400", "413", "415", "429", "503"} <= declared, path
            if method == "post" and "/equipment/" in path:
                assert {"409", "410", "423"} <= declared, path
    assert set(schema["components"]["schemas"]["ErrorOut"]["properties"]) >= {"error", "text"}
