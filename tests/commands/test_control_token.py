"""Two people and one machine."""

import pytest

from app.clock import ManualClock
from app.commands.control_token import ControlToken
from app.errors import Refused
from tests.commands.stand import ANA, IVO, VIT, person


class Desk:
    def __init__(self) -> None:
        self.clock = ManualClock()
        self.moving = False
        self.barred: set[str] = set()
        """Sessions that are over."""
        self.story: list[str] = []
        self.changed: list[str] = []
        self.token = ControlToken(
            self.clock,
            moving=lambda equipment: self.moving,
            changed=self.changed.append,
            journal=lambda who, equipment, what, former: self.story.append(f"{who.name if who else ''} {what}"),
            rights=lambda who: None if who.session in self.barred else who,
        )

    def pass_time(self, seconds: float) -> None:
        for _ in range(round(seconds * 4)):
            self.clock.advance(0.25)
            self.token.tick()

    @property
    def holder(self) -> str:
        holder = self.token.holder("m1")
        return holder.display if holder else ""

    @property
    def seen(self) -> str:
        """`Ana < Ivo! Eva`: who holds it and who waits; whoever is put to the holder is marked."""
        put = self.token.request_for("m1")
        waiting = [f"{place.display}{'!' * (place is put)}" for place in self.token.line("m1")]
        return " ".join([self.holder, *(["<", *waiting] if waiting else [])])


def refused(work: object, *args: object) -> tuple[str, int]:
    with pytest.raises(Refused) as refusal:
        work(*args)  # type: ignore[operator]
    return refusal.value.reason, refusal.value.status


def test_one_session_holds_a_machine_and_others_hear_who() -> None:
    desk = Desk()
    desk.token.take(ANA, "m1")
    assert desk.token.holds(ANA, "m1")
    assert refused(desk.token.take, IVO, "m1") == ("why.held", 423)
    assert refused(desk.token.take, person("ana", session="other"), "m1") == ("why.held", 423)
    desk.token.take(IVO, "m2")
    assert [machine for machine in ("m1", "m2") if desk.token.holds(IVO, machine)] == ["m2"]
    assert refused(desk.token.take, VIT, "m3") == ("why.role", 403)


def test_silence_yields_after_ten_seconds() -> None:
    desk = Desk()
    desk.token.take(ANA, "m1")
    request = desk.token.request(IVO, "m1")
    assert request is not None
    assert request.display == "Ivo"
    desk.pass_time(9.5)
    assert desk.holder == "Ana"
    desk.pass_time(0.75)
    assert desk.holder == "Ivo"
    assert desk.story == ["ana taken", "ivo taken_over"]


def test_the_holder_may_refuse_or_hand_over_at_once() -> None:
    desk = Desk()
    desk.token.take(ANA, "m1")
    desk.token.request(IVO, "m1")
    desk.token.refuse(ANA, "m1")
    desk.pass_time(15)
    assert desk.holder == "Ana"
    assert refused(desk.token.request, IVO, "m1") == ("why.take_over_refused", 423)
    desk.pass_time(16)
    desk.token.request(IVO, "m1")
    desk.token.request(person("eva"), "m1")
    assert desk.seen == "Ana < Ivo! Eva"
    assert refused(desk.token.give, IVO, "m1") == ("why.no_request", 409)
    desk.token.give(ANA, "m1")
    assert desk.holder == "Ivo"


def test_who_was_refused_does_not_ask_again_from_another_browser() -> None:
    desk = Desk()
    desk.token.take(ANA, "m1")
    desk.token.request(IVO, "m1")
    desk.token.refuse(ANA, "m1")
    desk.token.session_ended(IVO.session)
    again = person("ivo", session="anew")
    assert again.id == IVO.id
    desk.pass_time(29)
    assert refused(desk.token.request, again, "m1") == ("why.take_over_refused", 423)
    assert desk.token.request(person("eva"), "m1") is not None
    desk.token.refuse(ANA, "m1")
    desk.pass_time(1)
    assert desk.token.request(again, "m1") is not None


def test_a_request_for_a_free_machine_takes_it_and_a_released_one_goes_to_who_asks() -> None:
    desk = Desk()
    assert desk.token.request(ANA, "m1") is None
    assert desk.holder == "Ana"
    desk.token.request(IVO, "m1")
    desk.token.release(ANA, "m1")
    assert desk.holder == "Ivo"
    desk.token.release(ANA, "m1")
    assert desk.holder == "Ivo"


def test_the_token_is_free_ten_seconds_after_the_last_socket() -> None:
    desk = Desk()
    desk.token.socket_opened(ANA.session)
    desk.token.socket_opened(ANA.session)
    desk.token.take(ANA, "m1")
    desk.token.socket_closed(ANA.session)
    desk.pass_time(60)
    assert desk.holder == "Ana"
    desk.token.socket_closed(ANA.session)
    desk.pass_time(9)
    desk.token.socket_opened(ANA.session)  # a page was reloaded
    desk.pass_time(60)
    assert desk.holder == "Ana"
    desk.token.socket_closed(ANA.session)
    desk.pass_time(10)
    assert desk.holder == ""
    assert desk.story[-1] == "ana lost"


def test_the_token_is_free_after_a_quarter_of_an_hour_without_a_sign() -> None:
    desk = Desk()
    desk.token.take(ANA, "m1")
    desk.pass_time(890)
    desk.token.touch(ANA.session, "m1")
    desk.pass_time(890)
    desk.token.session_seen(ANA.session)
    desk.pass_time(890)
    assert desk.holder == "Ana"
    desk.pass_time(11)
    assert desk.holder == ""


def test_nothing_changes_hands_while_a_hold_to_run_moves_the_machine() -> None:
    desk = Desk()
    desk.token.take(ANA, "m1")
    desk.token.request(IVO, "m1")
    desk.moving = True
    desk.pass_time(20)
    assert desk.holder == "Ana"
    desk.token.request(person("eva"), "m1")
    assert desk.seen == "Ana < Ivo! Eva"
    assert refused(desk.token.give, ANA, "m1") == ("why.hold_active", 423)
    assert refused(desk.token.release, ANA, "m1") == ("why.hold_active", 423)
    desk.moving = False
    desk.pass_time(0.5)
    assert desk.holder == "Ivo"


def test_signing_out_frees_the_machines_and_withdraws_the_requests() -> None:
    desk = Desk()
    desk.token.take(ANA, "m1")
    desk.token.take(IVO, "m2")
    desk.token.request(IVO, "m1")
    desk.token.session_ended(IVO.session)
    assert desk.token.holder("m2") is None
    assert desk.token.request_for("m1") is None
    desk.token.session_ended(ANA.session)
    assert desk.holder == ""
    assert desk.story[-2:] == ["ivo revoked", "ana revoked"]  # not that their pages were gone
    assert set(desk.changed) == {"m1", "m2"}


def test_who_asked_and_left_gets_nothing_and_the_holder_keeps_the_machine() -> None:
    desk = Desk()
    for who in (ANA, IVO):
        desk.token.socket_opened(who.session)
    desk.token.take(ANA, "m1")
    desk.token.request(IVO, "m1")
    desk.pass_time(2)
    desk.token.socket_closed(IVO.session)
    desk.pass_time(9.5)
    assert desk.holder == "Ana"
    assert desk.token.request_for("m1") is not None, "a page that is loaded anew is no leaving"
    desk.changed.clear()
    desk.pass_time(0.75)
    assert desk.token.request_for("m1") is None
    assert desk.changed == ["m1"]
    desk.pass_time(60)
    assert desk.holder == "Ana"
    assert desk.story == ["ana taken"]


def test_who_asked_and_loads_the_page_anew_gets_it_when_back() -> None:
    desk = Desk()
    for who in (ANA, IVO):
        desk.token.socket_opened(who.session)
    desk.token.take(ANA, "m1")
    desk.token.request(IVO, "m1")
    desk.pass_time(9)
    desk.token.socket_closed(IVO.session)
    desk.pass_time(2)
    assert desk.holder == "Ana"
    desk.token.socket_opened(IVO.session)
    desk.pass_time(0.25)
    assert desk.holder == "Ivo"
