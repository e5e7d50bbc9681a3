"""Commands that are sent as a code: what the device answers, what the operator is told, and that nothing is sent twice."""

import struct

import pytest

from app.commands.gate import Question
from app.commands.interlocks import RefusalReason, raw, wrong_argument
from app.commands.lifecycle import Progress, ProgressState
from app.errors import LinkError, NoAnswer, Refused, Rejected
from app.plant.definitions import Argument, Type
from app.registers.plc_map import AnswerState
from app.tags.quality import GOOD, NO_DATA
from tests.commands.plc_stand import CLEAR, EDIT, START, STOP, PlcStand
from tests.commands.stand import ANA, EVA

LONGEST = 12.0
"""No command of the type goes on longer [s]."""


def progress(stand: PlcStand) -> Progress:
    found = stand.gate.progress("k1")
    assert found is not None
    return found


def end(stand: PlcStand) -> tuple[str, str]:
    found = progress(stand)
    assert found.over
    return str(found.state), found.reason


SWEEP = [
    # command, reply, acts, what the answer becomes when it is read again, state at once, state and reason at the end
    ("start", "accepted", True, [AnswerState.DONE], "accepted", "confirmed", ""),
    ("start", "running", True, [AnswerState.RUNNING, AnswerState.DONE], "accepted", "confirmed", ""),
    ("start", "done", True, [], "accepted", "confirmed", ""),
    ("start", "done", False, [], "accepted", "unconfirmed", "why.not_confirmed"),
    ("start", "accepted", False, [], "accepted", "unconfirmed", "why.not_confirmed"),
    ("start", "accepted", False, [AnswerState.FAILED], "accepted", "failed", "why.device_rejected"),
    ("start", "running", False, [AnswerState.EXPIRED], "accepted", "failed", "why.device_rejected"),
    ("start", "rejected", False, [], "failed", "failed", "why.device_rejected"),
    ("start", "failed", False, [], "failed", "failed", "why.device_rejected"),
    ("start", "expired", False, [], "failed", "failed", "why.device_rejected"),
    ("start", "none", False, [], "unknown", "unconfirmed", "why.not_confirmed"),
    ("start", "lost", True, [], "unknown", "confirmed", "why.unknown"),
    ("start", "not_arrived", False, [], "failed", "failed", "why.not_arrived"),
    ("start", "refused", False, [], "failed", "failed", "why.device_refused"),
    ("start", "busy", False, [], "unknown", "unconfirmed", "why.not_confirmed"),
    ("start", "overtaken", False, [], "superseded", "superseded", "why.overtaken"),
    ("clear", "accepted", True, [AnswerState.DONE], "accepted", "confirmed", ""),
    ("clear", "running", True, [AnswerState.RUNNING, AnswerState.DONE], "accepted", "confirmed", ""),
    ("clear", "done", True, [], "confirmed", "confirmed", ""),
    ("clear", "accepted", True, [], "accepted", "unconfirmed", "why.not_confirmed"),
    ("clear", "accepted", True, [NoAnswer("lost"), AnswerState.DONE], "accepted", "confirmed", ""),
    ("clear", "accepted", True, [None, None, AnswerState.DONE], "accepted", "confirmed", ""),
    ("clear", "running", True, [AnswerState.REJECTED], "accepted", "failed", "why.device_rejected"),
    ("clear", "rejected", False, [], "failed", "failed", "why.device_rejected"),
    ("clear", "none", False, [], "unknown", "unknown", "why.unknown"),
    ("clear", "lost", True, [], "unknown", "unknown", "why.unknown"),
    ("clear", "not_arrived", False, [], "failed", "failed", "why.not_arrived"),
    ("clear", "not_connected", False, [], "failed", "failed", "why.not_arrived"),
    ("clear", "bad_answer", False, [], "unknown", "unknown", "why.unknown"),
]


@pytest.mark.parametrize(("command", "reply", "acts", "later", "first", "state", "reason"), SWEEP)
async def test_every_answer_has_its_end_and_nothing_is_sent_twice(
    command: str,
    reply: str,
    acts: bool,
    later: list[AnswerState | LinkError | None],
    first: str,
    state: str,
    reason: str,
) -> None:
    stand = PlcStand()
    stand.plc.reply, stand.plc.acts, stand.plc.reason, stand.plc.later = reply, acts, 2, list(later)
    assert await stand.give(ANA, command) == first
    await stand.pass_time(LONGEST, until=lambda: progress(stand).over)
    assert end(stand) == (state, reason)
    assert len(stand.plc.orders) == 1
    assert stand.link.writes == []
    (line,) = stand.commands
    assert (line.object, line.result, line.reason) == (f"k1.{command}", state, reason)
    await stand.pass_time(3)
    assert len(stand.commands) == 1


async def test_an_answer_that_comes_late_confirms_nothing_before() -> None:
    stand = PlcStand()
    stand.link.door.clear()
    stand.plc.reply = "done"
    task = stand.gate._state.keep(stand.ask(ANA, "start", "k1"), "late")
    await stand.pass_time(0.9)
    assert progress(stand).state is ProgressState.REQUESTED
    await stand.open_door()
    assert (await task).state is ProgressState.ACCEPTED
    await stand.pass_time(0.2)
    assert end(stand) == ("confirmed", "")


async def test_a_machine_that_already_was_as_asked_proves_nothing_without_an_answer() -> None:
    stand = PlcStand()
    stand.set_drive("k1", state=1)
    stand.plc.reply = "none"
    await stand.give(ANA, "start")
    await stand.pass_time(3)
    assert end(stand) == ("unknown", "why.unknown_as_asked")


async def test_the_reason_of_the_device_is_told_in_its_own_words_and_an_unknown_one_as_its_number() -> None:
    stand = PlcStand()
    stand.plc.reply, stand.plc.reason = "rejected", 7
    await stand.give(ANA, "start")
    assert progress(stand).params["label"] == "reason.no_such_product"
    stand.plc.reason = 99
    await stand.give(ANA, "start")
    assert progress(stand).reason == "why.device_rejected_code"
    assert progress(stand).params["code"] == 99
    assert stand.commands[0].params["reason_label"] == "reason.no_such_product"
    assert stand.commands[1].params["reason_code"] == 99


async def test_the_answer_is_read_at_most_five_times_a_second_and_no_longer_than_needed() -> None:
    stand = PlcStand()
    stand.plc.reply = "running"
    await stand.give(ANA, "clear")
    await stand.pass_time(1.0)
    assert 4 <= len(stand.plc.asked) <= 6
    assert set(stand.plc.asked) == {1}
    stand.plc.later = [AnswerState.DONE]
    await stand.pass_time(0.4)
    read = len(stand.plc.asked)
    await stand.pass_time(2)
    assert len(stand.plc.asked) == read


async def test_what_moves_is_bound_to_the_state_that_was_seen() -> None:
    stand = PlcStand()
    stand.set_drive("k1", state=2)
    await stand.give(ANA, "start")
    await stand.give(ANA, "clear")
    await stand.give(ANA, "stop")
    assert [(code, expected) for code, _, expected, _ in stand.plc.orders] == [(START, 2), (CLEAR, 0), (STOP, 0)]
    assert stand.plc.owners == [ANA.id & 0xFFFF] * 3


async def test_a_command_in_a_dry_run_is_shown_and_not_sent() -> None:
    stand = PlcStand(dry_run=True)
    found = await stand.ask(ANA, "edit", "k1", arguments={"product": 5, "head": 100.5}, confirmed=True, reason="x")
    assert found.state is ProgressState.DRY_RUN
    assert found.telegrams == (("code", 6.0), ("product", 5.0), ("head", 100.5))
    assert stand.plc.orders == []


async def test_a_machine_that_goes_with_a_reload_leaves_no_command_behind() -> None:
    stand = PlcStand()
    stand.plc.reply = "running"
    await stand.give(ANA, "clear")
    stand.gate.configure(PlcStand().plant)  # it stays: the command goes on
    stand.plc.later = [AnswerState.DONE]
    await stand.pass_time(1)
    assert end(stand) == ("confirmed", "")


# ---- Stop -----------------------------------------------------------------------------------------------------


async def test_a_stop_needs_nothing_and_is_confirmed_by_the_machine() -> None:
    stand = PlcStand()
    stand.set_drive("k1", state=1, moving=1)
    found = await stand.gate.ask(ANA, "k1", "stop")
    assert found.state is ProgressState.ACCEPTED
    await stand.pass_time(0.3)
    assert end(stand) == ("confirmed", "")
    assert stand.plc.orders == [(STOP, (), 0, True)]


@pytest.mark.parametrize("reply", ["none", "lost", "not_arrived", "rejected", "failed", "refused", "busy"])
async def test_a_stop_is_repeated_with_fresh_requests_until_the_machine_stands(reply: str) -> None:
    stand = PlcStand()
    stand.set_drive("k1", state=1, moving=1)
    stand.plc.reply, stand.plc.acts = reply, False
    await stand.gate.ask(ANA, "k1", "stop")
    await stand.pass_time(3)
    assert len(stand.plc.orders) >= 5
    assert not progress(stand).over
    stand.plc.reply, stand.plc.acts = "done", True
    await stand.pass_time(1)
    assert end(stand)[0] == "confirmed"
    sent = len(stand.plc.orders)
    await stand.pass_time(2)
    assert len(stand.plc.orders) == sent
    assert all(order == (STOP, (), 0, True) for order in stand.plc.orders)


async def test_a_stop_that_nothing_confirms_raises_the_alarm() -> None:
    stand = PlcStand()
    stand.set_drive("k1", state=1, moving=1)
    stand.plc.reply, stand.plc.acts = "rejected", False
    await stand.gate.ask(ANA, "k1", "stop")
    await stand.pass_time(10.5)
    assert end(stand) == ("unconfirmed", "why.stop_not_confirmed")
    assert stand.alarms == ["k1"]


async def test_a_stop_overtakes_a_code_that_is_still_on_its_way() -> None:
    stand = PlcStand()
    stand.link.door.clear()
    task = stand.gate._state.keep(stand.ask(ANA, "start", "k1"), "start")
    await stand.pass_time(0.1)
    await stand.gate.ask(ANA, "k1", "stop")
    await stand.pass_time(0.3)
    assert not progress(stand).over  # the start may still arrive
    await stand.open_door()
    assert (await task).state is ProgressState.SUPERSEDED
    assert stand.line.values["moving"] == 1
    await stand.pass_time(1)
    assert end(stand) == ("confirmed", "")
    assert stand.line.values["moving"] == 0


# ---- arguments --------------------------------------------------------------------------------------------------

GIVEN: dict[str, str | float] = {"product": 5, "head": 100.5}


async def refusal(
    stand: PlcStand, arguments: dict[str, str | float], command: str = "edit", **asked: object
) -> Refused:
    asked = {"confirmed": True, "reason": "moved by hand"} | asked
    with pytest.raises(Refused) as refused:
        await stand.give(EVA, command, arguments=arguments, **asked)
    return refused.value


async def test_arguments_go_with_the_code_and_into_the_audit_trail() -> None:
    stand = PlcStand()
    state = await stand.give(EVA, "edit", arguments=GIVEN, confirmed=True, reason="moved by hand")
    assert state == "confirmed"
    assert stand.plc.orders == [(EDIT, (5, struct.unpack(">I", struct.pack(">f", 100.5))[0]), 0, False)]
    assert progress(stand).arguments == {"product": 5.0, "head": 100.5}
    (line,) = stand.commands
    assert (line.person, line.object, line.new, line.result) == (
        "eva",
        "k1.edit",
        "product = 5, head = 100.5",
        "confirmed",
    )
    assert line.params["arguments"] == {"product": 5.0, "head": 100.5}
    assert line.params["why"] == "moved by hand"
    assert line.params["telegrams"] == [["code", 6.0], ["product", 5.0], ["head", 100.5]]


async def test_what_a_person_types_is_read_in_the_person_s_language() -> None:
    stand = PlcStand()
    typed: dict[str, str | float] = {"product": "4294967295", "head": "100,5 mm"}
    await stand.give(EVA, "edit", arguments=typed, confirmed=True, reason="x", language="de")
    assert progress(stand).arguments == {"product": 4294967295.0, "head": 100.5}
    assert stand.plc.orders[0][1][0] == 0xFFFFFFFF


@pytest.mark.parametrize(
    ("changed", "reason", "argument"),
    [
        ({"product": 0}, "why.too_low", "product"),
        ({"product": 4294967296}, "why.out_of_limits", "product"),
        ({"product": 5.5}, "why.decimals", "product"),
        ({"product": ""}, "why.argument_missing", "product"),
        ({"product": "five"}, "why.not_a_number", "product"),
        ({"product": float("nan")}, "why.not_a_number", "product"),
        ({"head": -0.1}, "why.out_of_limits", "head"),
        ({"head": 660.1}, "why.out_of_limits", "head"),
        ({"head": 100.55}, "why.decimals", "head"),
        ({"head": float("inf")}, "why.not_a_number", "head"),
        ({"length": 30}, "why.unknown_argument", "length"),
    ],
)
async def test_an_argument_that_cannot_be_is_named(changed: dict[str, str | float], reason: str, argument: str) -> None:
    stand = PlcStand()
    refused = await refusal(stand, {**GIVEN, **changed})
    assert (refused.status, refused.params["argument"]) == (422, argument)
    assert refused.reason == reason
    assert stand.plc.orders == []
    (line,) = stand.commands
    assert (line.object, line.result) == ("k1.edit", "refused")
    assert "head" in str(line.new)


def test_a_limit_on_one_side_is_told_alone() -> None:
    def look(key: str) -> tuple[float | None, int]:
        return (10.0, GOOD) if key == "shortest" else (None, NO_DATA)

    lowest = Argument("length", Type.F32, "shortest", "", "mm")
    highest = Argument("length", Type.I32, "", "-5")
    unknown = Argument("length", Type.F32, "longest", "")
    found = wrong_argument(lowest, 9, look), wrong_argument(highest, -4, look), wrong_argument(unknown, 9, look)
    assert [reason.key if reason else "" for reason in found] == [
        "why.too_low",
        "why.too_high",
        "why.limits_unknown",
    ]
    assert found[0] is not None
    assert found[0].params["min"] == 10.0
    assert wrong_argument(lowest, 1e6, look) is None
    assert wrong_argument(Argument("length", Type.F32, "", "10"), 11, look) == RefusalReason(
        "why.too_high", {"argument": "length", "unit": "", "value": 11, "max": 10.0}, ""
    )
    assert [raw(Argument("n", Type.I32), -1), raw(Argument("n", Type.U32), 7)] == [0xFFFFFFFF, 7]


async def test_arguments_for_a_command_without_any_are_refused() -> None:
    refused = await refusal(PlcStand(), {"product": 1}, "clear")
    assert (refused.reason, refused.status) == ("why.unknown_argument", 422)


async def test_a_number_that_can_be_read_in_two_ways_is_asked_back() -> None:
    stand = PlcStand()
    with pytest.raises(Question) as asked:
        await stand.give(
            EVA, "edit", arguments={"product": 5, "head": "1.234"}, confirmed=True, reason="x", language="de"
        )
    assert asked.value.params["argument"] == "head"
    assert {asked.value.params["a"], asked.value.params["b"]} == {1234.0, 1.234}
    assert stand.commands == []


async def test_limits_that_are_not_known_let_nothing_through() -> None:
    stand = PlcStand()
    stand.bad.add("k1")
    await stand.pass_time(0.2)
    refused = await refusal(stand, GIVEN)
    assert refused.reason == "why.no_communication"
    assert stand.plc.orders == []


async def test_the_reason_is_asked_for_with_the_confirmation_and_before_anything_happens() -> None:
    stand = PlcStand()
    with pytest.raises(Question) as asked:
        await stand.give(EVA, "edit", arguments=GIVEN)
    assert (asked.value.reason, asked.value.params["needs_reason"]) == ("why.confirm", True)
    assert asked.value.params["arguments"] == {"product": 5.0, "head": 100.5}
    with pytest.raises(Question) as asked:
        await stand.give(EVA, "edit", arguments=GIVEN, confirmed=True, reason="  ")
    assert asked.value.reason == "why.reason_needed"
    assert (stand.plc.orders, stand.commands) == ([], [])


async def test_two_products_may_be_edited_at_once_but_one_press_is_one_command() -> None:
    stand = PlcStand()
    for product in (5, 6, 6):
        await stand.give(
            EVA, "edit", arguments={**GIVEN, "product": product}, confirmed=True, reason="x", id=f"press-{product}"
        )
    assert [arguments[0] for _, arguments, _, _ in stand.plc.orders] == [5, 6]


async def test_a_set_of_setpoints_that_the_device_does_not_take_says_why() -> None:
    stand = PlcStand()
    stand.link.spoil = lambda equipment, point, value: Rejected(point, 7, 3)
    found = await stand.set(EVA, "speed", 31, "k1", confirmed=True)
    assert (found.state, found.reason) == (ProgressState.FAILED, "why.device_rejected")
    assert (found.params["label"], found.params["detail"]) == ("reason.no_such_product", 3)


async def test_a_setpoint_of_one_decimal_is_not_confirmed_by_its_neighbour() -> None:
    stand = PlcStand()
    stand.line.deaf = True
    await stand.set(EVA, "speed", 31, "k1", confirmed=True)
    await stand.pass_time(6)
    assert end(stand) == ("unconfirmed", "why.value_differs")
