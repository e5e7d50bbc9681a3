"""Commands over HTTP at a running demo plant: who may, what is answered, in which words, and what the audit keeps."""

import asyncio
import html
import re
from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from app.access.audit.search import Filter
from app.sim.sinamics.adjustment import STATE
from app.sim.sinamics.adjustment import State as Adjusted
from app.sim.training import REG_MACHINE_FAULT
from tests.web.operating import Operator, button, line_of, runtime_of, until, whole_line_of, words
from tests.web.people import BOSS, Staff

LANGUAGES = ("hr", "en", "de", "cs")
SIGN_IN = {
    "hr": "Prijavi se za upravljanje",
    "en": "Sign in to operate",
    "de": "Zum Bedienen anmelden",
    "cs": "Pro ovládání se přihlaste",
}


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Staff:
    crew = Staff(demo)
    runtime = runtime_of(demo)
    assert until(lambda: runtime.tags.sample("m1.speed").value and runtime.tags.sample("m2.status").value == 0)
    assert until(lambda: runtime.tags.sample("m1.f905").seen and runtime.tags.sample("m2.f905").seen)
    return crew


@pytest.fixture(scope="module")
def ana(staff: Staff) -> Operator:
    return Operator(staff, "ana", ("operator",))


@pytest.fixture(scope="module")
def ivo(staff: Staff) -> Operator:
    return Operator(staff, "ivo", ("engineer", "operator"))


@pytest.fixture(autouse=True)
def calm(staff: Staff, ana: Operator, ivo: Operator) -> Iterator[None]:
    """Every test begins with machines that nobody holds, and may ask as often as it likes."""
    gate = runtime_of(staff.client).gate
    assert gate is not None
    staff.wait(_free)
    gate._admission.rate.take = lambda _person: True  # type: ignore[method-assign]
    for equipment in ("m1", "m2"):
        holder = gate.control.holder(equipment)
        if holder is not None:
            staff.wait(_in_loop, gate.control.session_ended, holder.session)
    yield
    assert until(lambda: all((p := gate.progress(e)) is None or p.over for e in ("m1", "m2")))
    ending = "why.hold_ending"
    assert until(lambda: all(ending not in [r.key for r in gate.why_not(None, e, "forward")] for e in ("m1", "m2")))


async def _free() -> None:
    await asyncio.sleep(0)


async def _in_loop(work: object, *arguments: object) -> None:
    work(*arguments)  # type: ignore[operator]


def value(staff: Staff, name: str) -> float:
    found = runtime_of(staff.client).tags.sample(name).value
    assert isinstance(found, int | float)
    return found


def settled(staff: Staff, equipment: str) -> str:
    """The state in which the last command of the machine ended."""
    gate = runtime_of(staff.client).gate
    assert gate is not None
    assert until(lambda: (p := gate.progress(equipment)) is not None and p.over)
    progress = gate.progress(equipment)
    assert progress is not None
    return str(progress.state)


def lines_of(staff: Staff, object: str) -> int:
    """Commands of the audit about `object`; that each was sent is a line of its own."""
    found = staff.wait(staff.access.audit.find, Filter(object=object), 500)
    return sum(line.kind == "command" for line in found)


# ---- who ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_guest_reads_on_every_button_that_one_has_to_sign_in(staff: Staff, language: str) -> None:
    staff.have()
    staff.client.cookies.set("pogon_lang", language)
    answer = staff.client.get("/equipment/m1/commands")
    for command in ("forward", "reverse", "stop", "coast", "reset", "jog_forward", "jog_reverse"):
        source = button(answer, f"m1.{command}")
        assert 'aria-disabled="true"' in source
        assert SIGN_IN[language] in words(source)


def test_a_guest_learns_no_name(staff: Staff, ana: Operator) -> None:
    ana.take("m1")
    ana.post("/equipment/m1/stop")
    settled(staff, "m1")
    staff.have()
    staff.client.cookies.set("pogon_lang", "en")
    page = staff.client.get("/equipment/m1").text
    assert "Operator" in page
    assert "ana" not in re.sub(r'(?:href|src|data-[\w-]+|content)="[^"]*"', "", words(page)).lower().split()


def test_nobody_commands_without_sign_in_and_a_viewer_neither(staff: Staff) -> None:
    staff.have()
    for path in ("/equipment/m1/command/forward", "/equipment/m1/stop", "/equipment/m1/token/take"):
        assert staff.post(path, {}, **{"HX-Request": "true"}).status_code == 401
    vera = Operator(staff, "vera", ("viewer",))
    for path in ("/equipment/m1/command/forward", "/equipment/m1/stop", "/equipment/m1/hold/jog_forward"):
        assert vera.post(path).status_code == 403
    assert vera.get("/nonce").status_code == 403


def test_a_machine_or_command_that_is_not_there_is_404(ana: Operator) -> None:
    assert ana.press("/equipment/m9/command/forward").status_code == 404
    assert ana.press("/equipment/m1/command/fly").status_code == 404
    assert ana.press("/equipment/m1/setpoint/f999", argument="1").status_code == 404
    assert ana.post("/equipment/m1/token/steal").status_code == 404


# ---- the control token ----------------------------------------------------------------------------------------


def test_without_the_control_token_a_command_is_423_and_says_so_on_the_button(ana: Operator) -> None:
    answer = ana.press("/equipment/m1/command/forward")
    assert answer.status_code == 423
    assert line_of(answer) == "Take control first"
    assert "Take control first" in words(button(answer, "m1.forward"))
    assert 'aria-disabled="true"' not in button(answer, "m1.stop")


@pytest.mark.parametrize("machine", ["m1", "c1", "cc1", "seq1", "cr1", "a1"])
def test_what_is_refused_is_named_with_its_machine(ana: Operator, machine: str) -> None:
    """Every command, and every setpoint that is written by itself: the message line stands far from what was pressed."""
    runtime = runtime_of(ana.staff.client)
    assert runtime.plant
    item = runtime.plant.equipment[machine]
    asked = {
        f"command/{key}": command.label
        for key, command in item.type.commands.items()
        if not (command.stop or command.hold)
    }
    asked |= {f"setpoint/{key}": item.type.points[key].label for key in item.type.setpoints}
    assert asked
    for path, label in asked.items():
        answer = ana.press(f"/equipment/{machine}/{path}", argument="1", confirmed="1")
        line = whole_line_of(answer)
        assert answer.status_code >= 400 and line.startswith(
            f"{machine.upper()} {words(runtime.texts.of_type('en', item.type, label))}: "
        ), (path, line)
        assert line.endswith(f": {line_of(answer)}") and line_of(answer)


def test_two_operators_and_one_machine(staff: Staff, ana: Operator, ivo: Operator) -> None:
    ana.take("m1")
    refused = ivo.press("/equipment/m1/command/coast")
    assert refused.status_code == 423
    assert "ana" in line_of(refused)
    assert ivo.post("/equipment/m1/token/request").status_code == 200
    assert "ivo asks for control" in words(ana.get("/equipment/m1/commands").text)
    assert ana.post("/equipment/m1/token/refuse").status_code == 200
    assert ivo.post("/equipment/m1/token/request").status_code == 423
    assert ana.post("/equipment/m1/token/release").status_code == 200
    ivo.take("m1")
    assert ana.press("/equipment/m1/command/coast").status_code == 423
    assert ivo.post("/equipment/m1/token/refuse").status_code == 409


TAKEN = {
    "hr": ("Upravljanje preuzeto", "Vi upravljate"),
    "en": ("Control taken", "You are in control"),
    "de": ("Bedienhoheit übernommen", "Bedienhoheit bei Ihnen"),
    "cs": ("Ovládání převzato", "Ovládáte vy"),
}


@pytest.mark.parametrize("lang", LANGUAGES)
def test_what_the_message_line_says_of_control_names_the_machine(
    staff: Staff, ana: Operator, ivo: Operator, lang: str
) -> None:
    """A faceplate of one machine may lie over the page of another, and a page may show several."""
    ana.language = ivo.language = lang
    try:
        taken = ana.post("/equipment/m2/token/take")
        refused = ivo.post("/equipment/m2/token/take")
        hers, his = (html.unescape(who.get("/equipment/m2/commands").text) for who in (ana, ivo))
    finally:
        ana.language = ivo.language = "en"
        ana.post("/equipment/m2/token/release")
    did, mine = TAKEN[lang]
    assert line_of(taken) == f"M2: {did}"
    assert f'data-told="M2: {mine}"' in hers
    assert refused.status_code == 423
    assert re.match("M2: .*ana", line_of(refused))
    assert re.search('data-told="M2: [^"]*ana', his)


def test_one_cause_that_all_commands_lack_is_said_once_whatever_each_lacks_besides(staff: Staff, ana: Operator) -> None:
    """A small panel has no other place for it: buttons count what is missing besides, the line under them does not."""
    cause = "Drive not enabled: press Enable first"
    ana.post("/equipment/a1/stop")
    assert settled(staff, "a1") == "confirmed"
    ana.take("a1")
    drive = runtime_of(staff.client).sim.devices["a1"]  # type: ignore[union-attr]
    drive._value[STATE] = Adjusted.NOT_ADJUSTED
    assert until(lambda: value(staff, "a1.zsw1_home_position_set") == 0)
    answer = ana.get("/equipment/a1/commands")
    drive._value[STATE] = Adjusted.ADJUSTED
    ana.post("/equipment/a1/token/release")
    assert f"{cause}, and 1 more" in words(button(answer, "a1.move_absolute"))
    assert words(button(answer, "a1.intermediate_stop")).endswith(cause)
    assert f'data-part="a1.why">{cause}</p>' in answer.text


# ---- commands -------------------------------------------------------------------------------------------------


def test_stop_needs_no_token_no_nonce_and_no_script(staff: Staff, ana: Operator) -> None:
    answer = ana.post("/equipment/m1/stop", fragment=False, next="/equipment/m1")
    assert answer.status_code == 303
    assert answer.headers["location"] == "/equipment/m1"
    assert settled(staff, "m1") == "confirmed"
    assert until(lambda: value(staff, "m1.speed") == 0)


@pytest.mark.sweep(8)
def test_forward_is_accepted_then_confirmed_and_everybody_reads_by_whom(
    staff: Staff, ana: Operator, ivo: Operator
) -> None:
    ana.post("/equipment/m1/stop")
    assert settled(staff, "m1") == "confirmed"
    ana.take("m1")
    answer = ana.press("/equipment/m1/command/forward")
    assert answer.status_code == 202
    assert re.fullmatch(r"M1 Forward: Accepted \d\d:\d\d:\d\d · ana", line_of(answer))
    assert 'data-state="accepted"' in button(answer, "m1.forward")
    assert answer.headers["x-command"]
    assert settled(staff, "m1") == "confirmed"
    assert until(lambda: value(staff, "m1.speed") > 500)
    seen = ivo.get("/equipment/m1/commands")
    assert re.search(r"Accepted \d\d:\d\d:\d\d → Done \d\d:\d\d:\d\d · ana", words(seen.text))


@pytest.mark.sweep(8)
def test_reverse_while_running_asks_first_and_nothing_is_in_the_audit_before_the_answer(
    staff: Staff, ana: Operator
) -> None:
    ana.take("m1")
    if value(staff, "m1.status") != 1:
        ana.press("/equipment/m1/command/forward")
        assert settled(staff, "m1") == "confirmed"
    before = lines_of(staff, "m1.reverse")
    asked = ana.press("/equipment/m1/command/reverse", id="press-1")
    assert asked.status_code == 409
    assert "<dialog" in asked.text
    assert 'name="confirmed" value="1"' in asked.text
    assert 'name="id" value="press-1"' in asked.text
    assert re.search(r"<button[^>]*data-cancel[^>]*data-first", asked.text)
    assert lines_of(staff, "m1.reverse") == before
    answer = ana.press("/equipment/m1/command/reverse", id="press-1", confirmed="1")
    assert answer.status_code == 202
    assert settled(staff, "m1") == "confirmed"
    assert until(lambda: value(staff, "m1.speed") < -100)
    assert until(lambda: lines_of(staff, "m1.reverse") == before + 1)


def test_a_double_press_is_one_command_and_one_line(staff: Staff, ana: Operator) -> None:
    ana.take("m1")
    before = lines_of(staff, "m1.coast")
    first = ana.press("/equipment/m1/command/coast", id="twice")
    second = ana.press("/equipment/m1/command/coast", id="twice")
    assert first.headers["x-command"] == second.headers["x-command"] == "twice"
    assert settled(staff, "m1") == "confirmed"
    assert until(lambda: lines_of(staff, "m1.coast") == before + 1)


def test_a_nonce_is_good_once_and_only_for_its_session(ana: Operator, ivo: Operator) -> None:
    ana.take("m1")
    assert ana.post("/equipment/m1/command/coast").status_code == 410
    nonce = ivo.nonce()
    assert ana.post("/equipment/m1/command/coast", nonce=nonce).status_code == 410
    nonce = ana.nonce()
    assert ana.post("/equipment/m1/command/coast", nonce=nonce).status_code in (200, 202)
    again = ana.post("/equipment/m1/command/coast", nonce=nonce)
    assert again.status_code == 410
    assert line_of(again) == "Command expired. Press again."


def test_a_field_that_is_not_asked_for_is_refused(ana: Operator) -> None:
    assert ana.press("/equipment/m1/command/forward", role="admin").status_code == 422


def test_a_fault_says_what_is_missing_with_cause_and_remedy_and_is_reset(staff: Staff, ana: Operator) -> None:
    link = runtime_of(staff.client).links["hall"]
    ana.take("m1")
    staff.wait(link.raw_write, 1, REG_MACHINE_FAULT, [4])
    assert until(lambda: value(staff, "m1.status") == 4)
    refused = ana.press("/equipment/m1/command/forward")
    assert refused.status_code == 409
    assert line_of(refused) == "The drive has a fault: remove its cause, then fault reset"
    face = words(ana.get("/equipment/m1/faceplate").text)
    assert "OC overcurrent" in face
    assert "Cause: Ramp too short" in face
    assert "Remedy: Check motor, cable and load." in face
    assert "8 of 9" in face
    staff.wait(link.raw_write, 1, REG_MACHINE_FAULT, [0])
    staff.wait(asyncio.sleep, 0.5)  # the cause goes with the next step of the drive
    answer = ana.press("/equipment/m1/command/reset")
    assert answer.status_code == 202, line_of(answer)
    assert settled(staff, "m1") == "confirmed"
    assert until(lambda: value(staff, "m1.status") == 0)


# ---- setpoints ------------------------------------------------------------------------------------------------


def test_a_setpoint_in_the_normal_range_is_one_press_in_the_numbers_of_the_language(
    staff: Staff, ivo: Operator
) -> None:
    ivo.take("m1")
    ivo.language = "hr"
    try:
        seen = str(value(staff, "m1.frequency_setpoint"))
        answer = ivo.press("/equipment/m1/command/set_frequency", argument="38,5", expected=seen)
        assert answer.status_code == 202, line_of(answer)
        assert "38,5 Hz" in line_of(answer)
        assert settled(staff, "m1") == "confirmed"
        assert value(staff, "m1.frequency_setpoint") == 38.5
        back = ivo.press("/equipment/m1/command/set_frequency", argument="40", expected="38.5")
        assert back.status_code == 202
        assert settled(staff, "m1") == "confirmed"
    finally:
        ivo.language = "en"


def test_a_value_that_means_two_things_is_asked(staff: Staff, ivo: Operator) -> None:
    ivo.take("m1")
    ivo.language = "hr"
    try:
        answer = ivo.press("/equipment/m1/command/set_frequency", argument="1.234")
        assert answer.status_code == 422
        assert "Jeste li mislili 1 234 ili 1,234?" in words(answer.text)
        assert re.findall(r'name="argument" value="([^"]*)"', answer.text) == ["1234", "1,234"]
    finally:
        ivo.language = "en"


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("typed", "words_of_it"),
    [
        ("70", "Permitted: 0.5 to 50 Hz"),
        ("abc", "Not a number: abc"),
        ("40.123", "Too many decimal places. Permitted: 2"),
        ("", "Required field: Frequency setpoint"),
    ],
)
def test_a_wrong_value_is_422_with_what_is_permitted(ana: Operator, typed: str, words_of_it: str) -> None:
    ana.take("m1")
    answer = ana.press("/equipment/m1/command/set_frequency", argument=typed)
    assert answer.status_code == 422
    assert line_of(answer) == words_of_it


def test_outside_the_normal_band_now_and_new_are_shown_before_it_is_set(staff: Staff, ana: Operator) -> None:
    ana.take("m1")
    now = value(staff, "m1.frequency_setpoint")
    asked = ana.press("/equipment/m1/command/set_frequency", argument="20", expected=str(now))
    assert asked.status_code == 409
    card = words(asked.text)
    assert "Outside the normal range" in card
    assert f"now new {now:.2f} Hz 20.00 Hz" in card
    assert f"difference −{now - 20:.2f} Hz" in card
    assert value(staff, "m1.frequency_setpoint") == now
    answer = ana.press("/equipment/m1/command/set_frequency", argument="20", expected=str(now), confirmed="1")
    assert answer.status_code == 202
    assert settled(staff, "m1") == "confirmed"
    back = ana.press("/equipment/m1/command/set_frequency", argument="40", expected="20", confirmed="1")
    assert back.status_code == 202
    assert settled(staff, "m1") == "confirmed"


def test_a_setpoint_that_changed_meanwhile_is_not_overwritten(ana: Operator) -> None:
    ana.take("m1")
    answer = ana.press("/equipment/m1/command/set_frequency", argument="41", expected="35")
    assert answer.status_code == 409
    assert line_of(answer) == "Changed meanwhile: now 40 Hz"


# ---- hold-to-run ------------------------------------------------------------------------------------------------


def test_m1_says_why_it_cannot_be_held_and_m2_gives_a_lease(staff: Staff, ana: Operator) -> None:
    ana.take("m1")
    assert "Drive would run on after a lost connection: F905 must be above 0 and at most 2 s" in words(
        button(ana.get("/equipment/m1/commands"), "m1.jog_forward")
    )
    refused = ana.press("/equipment/m1/hold/jog_forward")
    assert refused.status_code == 409
    assert "F905" in line_of(refused)
    ana.take("m2")
    lease = ana.press("/equipment/m2/hold/jog_forward").json()["lease"]
    assert value(staff, "m2.status") == 0
    assert ana.post("/equipment/m2/release", lease=lease, cause="left").status_code == 204
    assert ana.post("/equipment/m2/release", lease=lease).status_code == 204
    assert ana.press("/equipment/m2/command/jog_forward").status_code == 409


@pytest.mark.sweep(8)
def test_the_socket_keeps_a_hold_alive_and_its_end_ends_the_motion(staff: Staff, ana: Operator) -> None:
    ana.take("m2")
    lease = ana.press("/equipment/m2/hold/jog_forward").json()["lease"]
    ana.sit()
    headers = {"origin": "http://127.0.0.1:8000"}
    with staff.client.websocket_connect("ws://127.0.0.1:8000/live", headers=headers) as socket:
        socket.send_json({"subscribe": "frame", "rev": 0})
        for counter in range(1, 16):
            socket.send_json({"hold": {"equipment": "m2", "lease": lease, "counter": counter}})
            while "hold" not in (message := socket.receive_json()):
                pass
            assert message["hold"] == {"lease": lease, "counter": counter}
            staff.wait(asyncio.sleep, 0.1)
        assert until(lambda: value(staff, "m2.frequency") > 0, 2)
    assert settled(staff, "m2") == "confirmed"
    assert until(lambda: value(staff, "m2.frequency") == 0)
    gate = runtime_of(staff.client).gate
    assert gate is not None
    progress = gate.progress("m2")
    assert progress is not None
    assert progress.reason == "hold.cause.closed"


@pytest.mark.sweep(8)
@pytest.mark.parametrize("way", ["page", "terminal", "disabled", "reset"])
def test_a_hold_and_its_socket_end_when_the_right_does(staff: Staff, way: str) -> None:
    """Armed and kept alive by somebody whose role goes, on a page or by another process: nothing moves any more, nothing starts."""
    eve = Operator(staff, f"eve.{way}", ("operator",))
    eve.sit()
    eve.take("m2")
    lease = eve.press("/equipment/m2/hold/jog_forward").json()["lease"]
    eve.sit()
    gate, ended = runtime_of(staff.client).gate, False
    assert gate is not None
    person = staff.add(eve.name, "operator")
    headers = {"origin": "http://127.0.0.1:8000"}
    with staff.client.websocket_connect("ws://127.0.0.1:8000/live", headers=headers) as socket:
        socket.send_json({"subscribe": "frame", "rev": 0})
        for counter in range(1, 30):
            if counter == 4:
                people = staff.access.people
                if way == "page":
                    staff.wait(people.set_roles, BOSS, person, ["viewer"])
                elif way == "terminal":
                    people.set_roles_now(BOSS, eve.name, ["viewer"])
                elif way == "disabled":
                    staff.wait(people.disable, BOSS, person, True)
                else:
                    people.set_password_now(BOSS, eve.name, None)
            try:
                socket.send_json({"hold": {"equipment": "m2", "lease": lease, "counter": counter}})
                while "hold" not in socket.receive_json():
                    pass
            except (WebSocketDisconnect, RuntimeError):
                ended = True
                break
            staff.wait(asyncio.sleep, 0.1)
    assert ended
    assert until(lambda: value(staff, "m2.frequency") == 0)
    assert until(lambda: gate.control.holder("m2") is None)
    progress = gate.progress("m2")
    assert progress is not None
    assert settled(staff, "m2") in ("confirmed", "unconfirmed")
    progress = gate.progress("m2")
    assert progress is not None
    assert progress.reason in ("hold.cause.session", "hold.cause.token", "hold.cause.closed")


# ---- parameters -------------------------------------------------------------------------------------------------


def test_an_operator_reads_parameters_and_only_an_engineer_writes_them(ana: Operator, ivo: Operator) -> None:
    page = ana.get("/equipment/m1/parameters", fragment=False)
    assert page.status_code == 200
    assert "F114" in page.text
    assert "data-new" not in page.text
    assert ana.post("/equipment/m1/parameters", key="f114", value="6", expected="5").status_code == 403
    assert ivo.get("/equipment/m1/parameters", fragment=False).text.count("data-new") > 30


@pytest.mark.parametrize("language", LANGUAGES)
def test_unconfirmed_parameters_and_choices_are_marked_in_every_language(ivo: Operator, language: str) -> None:
    ivo.language = language
    try:
        page = ivo.get("/equipment/m1/parameters", fragment=False).text
        row = re.search(r'<tr data-key="f801".*?</tr>', page, re.S)
        assert row is not None
        assert 'class="badge soft"' in row[0]
        sure = re.search(r'<tr data-key="f114".*?</tr>', page, re.S)
        assert sure is not None
        assert 'class="badge soft"' not in sure[0]
        assert '<option value="6">6 – 57600</option>' in page
        assert "[en]" not in page
    finally:
        ivo.language = "en"


def test_parameters_are_read_again_on_demand(ana: Operator) -> None:
    answer = ana.post("/equipment/m1/parameters/read")
    assert answer.status_code == 200
    assert re.fullmatch(r"Read from the drive: \d+", line_of(answer))


def test_a_list_of_changes_that_does_not_fit_together_is_refused(ivo: Operator) -> None:
    assert ivo.post("/equipment/m1/parameters", key="f114", value="6").status_code == 422


# ---- faceplate --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_faceplate_is_a_dialog_for_a_script_and_a_page_without(ana: Operator, language: str) -> None:
    ana.language = language
    try:
        dialog = ana.get("/equipment/m2/faceplate").text
        page = ana.get("/equipment/m2/faceplate", fragment=False).text
    finally:
        ana.language = "en"
    assert dialog.lstrip().startswith(("{#", "<dialog"))
    assert "<html" not in dialog
    assert page.count("<h1>") == 1
    for text in (dialog, page):
        assert 'data-part="m2.stop"' in text
        assert re.search(r"\[[\w.]+\]", words(text)) is None
