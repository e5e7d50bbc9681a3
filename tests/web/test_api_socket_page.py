"""The socket, and the id of a command, as docs/api.md describes them, against what is sent and taken."""

import json
import re
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient
from pydantic import BaseModel
from starlette.websockets import WebSocketDisconnect

from app.access.sessions import hash_of
from app.main import create_app
from app.settings import Settings
from app.web import socket as live
from app.web.api.commands import CommandIn, SetIn
from tests.conftest import ROOT
from tests.web.people import BOSS, HOST, Staff

SECTION = (ROOT / "docs" / "api.md").read_text("utf-8").partition("## The socket")[2]
ASKED = ("m1.speed", "m1.pwoer", "sys.link.hall.state")


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    app = create_app(Settings(data=tmp_path_factory.mktemp("socket_page") / "data"))
    with TestClient(app, base_url=HOST, follow_redirects=False, client=("127.0.0.1", 50000)) as client:
        yield Staff(client)


def table(head: str) -> dict[str, list[str]]:
    """First cell, without its marks, to the others, of the table of the page that begins with `head`."""
    rows = SECTION[SECTION.index(f"| {head} |") :].partition("\n\n")[0].splitlines()[2:]
    cells = [[cell.strip() for cell in row.strip("|").split(" | ")] for row in rows]
    return {first.strip("` "): rest for first, *rest in cells}


def heard(staff: Staff, *said: object) -> tuple[list[dict[str, Any]], int]:
    """The first two answers to what is said, and the code with which the socket is closed; 0 = it stays open."""
    answers: list[dict[str, Any]] = []
    with staff.client.websocket_connect("ws://127.0.0.1:8000/live", headers={"Origin": HOST}) as socket:
        for one in said:
            socket.send_text(one if isinstance(one, str) else json.dumps(one))
        try:
            while len(answers) < 2:
                answers.append(socket.receive_json())
        except WebSocketDisconnect as end:
            return answers, end.code
    return answers, 0


def tags(*names: str) -> dict[str, str]:
    return {"subscribe": f"tags/{','.join(names)}"}


def test_a_hello_and_a_frame_have_what_the_page_says_and_nothing_else(staff: Staff) -> None:
    staff.enter("eva", "viewer")
    (first, frame), code = heard(staff, tags(*ASKED))
    hello = first["hello"]
    assert code == 0
    assert set(hello) == set(table("`hello`"))
    assert (hello["kind"], hello["unknown"], hello["denied"]) == (f"tags/{','.join(ASKED)}", [ASKED[1]], [ASKED[2]])
    assert set(frame) == set(table("field"))
    assert {handle for handle, *_ in frame["v"]} == set(hello["handles"].values())
    with_all = set(re.findall(r"`(sys\.[\w.]+)`", table("`hello`")["handles"][0]))
    assert with_all and with_all < set(hello["handles"])
    example = json.loads(re.search(r'← (\{"hello".*)', SECTION)[1])["hello"]  # type: ignore[index]
    assert set(example) == set(table("`hello`")) - {"unknown", "denied"}
    assert set(heard(staff, tags("m1.speed"))[0][0]["hello"]) == set(example)


def test_no_tag_left_is_a_refusal_of_rights_and_not_of_names(staff: Staff) -> None:
    staff.enter("eva", "viewer")
    assert heard(staff, tags(ASKED[2])) == ([{"error": "not_allowed"}], 1008)
    assert heard(staff, tags(*ASKED[1:])) == ([{"error": "not_allowed"}], 1008)
    everywhere = heard(staff, {"subscribe": "frame"})[0][0]["hello"]["handles"]
    for names in ((ASKED[1],), ()):
        (hello, frame), code = heard(staff, tags(*names))
        assert code == 0 and hello["hello"].get("unknown", []) == list(names)
        assert hello["hello"]["handles"] == everywhere and frame["v"]


def test_each_error_of_the_page_comes_with_its_code_and_there_are_no_others(staff: Staff) -> None:
    staff.enter("eva", "viewer")
    told = {name: int(code) for name, (code, _) in table("`error`").items()}
    causes: dict[str, list[object]] = {
        "bad_message": ["subscribe"],
        "unknown_kind": [{"subscribe": "pages/m1"}],
        "not_allowed": [tags(ASKED[2])],
        "too_many_tags": [tags(*(f"x{n}" for n in range(live.MOST_TAGS + 1)))],
        "too_large": [tags("x" * live.LARGEST_MESSAGE)],
        "too_fast": [{"pong": 1}] * int(live.AT_ONCE + 5),
    }
    for name, said in causes.items():
        assert heard(staff, *said) == ([{"error": name}], told[name])
    assert set(told) - set(causes) == {"unavailable"}, "that one: tests/web/test_guard.py"
    source = (ROOT / "app" / "web" / "socket.py").read_text("utf-8")
    assert set(re.findall(r'_Refuse\(\s*"(\w+)"', source)) | {"too_large"} == set(told)


def test_the_limits_of_the_page_are_those_of_the_socket() -> None:
    for said in (
        f"more than {live.MOST_TAGS} tags",
        f"above {live.LARGEST_MESSAGE} characters",
        f"more than {live.MESSAGES:g} messages a second, and {live.AT_ONCE:g} at once",
        f"within {live.FIRST_WORD:g} s",
        f"again every {live.RECHECK:g} s",
        f"not taken for {live.SLOWEST_SEND:g} s",
        f"A session may have {live.MOST_PER_SESSION}, visitors without sign-in {live.MOST_PER_ADDRESS} from one address",
        f"{live.MOST_GUESTS} in all",
    ):
        assert said in SECTION.replace("\n", " "), said


@pytest.mark.parametrize("asked", [CommandIn, SetIn])
def test_the_page_says_how_long_an_id_is(asked: type[BaseModel]) -> None:
    told = asked.model_json_schema()["properties"]["id"]
    page = (ROOT / "docs" / "api.md").read_text("utf-8")
    assert f"`id` has {told['minLength']} to {told['maxLength']} characters" in page


def test_whose_session_ends_is_told_so_before_the_socket_closes(staff: Staff) -> None:
    sid, said = staff.enter("mia", "operator"), []
    with staff.client.websocket_connect("ws://127.0.0.1:8000/live", headers={"Origin": HOST}) as socket:
        socket.send_text(json.dumps(tags(ASKED[0])))
        assert "hello" in socket.receive_json()
        staff.wait(staff.access.sessions.end, BOSS, hash_of(sid))
        with pytest.raises(WebSocketDisconnect) as end:
            while True:
                said.append(socket.receive_json())
    assert said[-1] == {"error": "not_allowed"} and end.value.code == 1008


def test_who_has_other_rights_connects_anew_and_is_not_told_that_the_session_is_over(staff: Staff) -> None:
    staff.enter("jan", "operator")
    said: list[Any] = []
    with staff.client.websocket_connect("ws://127.0.0.1:8000/live", headers={"Origin": HOST}) as socket:
        socket.send_text(json.dumps(tags(ASKED[0])))
        assert "hello" in socket.receive_json()
        staff.wait(staff.access.people.set_roles, BOSS, staff.add("jan"), ["viewer"])
        with pytest.raises(WebSocketDisconnect) as end:
            while True:
                said.append(socket.receive_json())
    assert not any("error" in one for one in said) and end.value.code == 1008
