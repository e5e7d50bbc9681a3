"""The second factor: enrolment, codes once and in time, recovery codes, who must have one, what is kept where."""

import base64
import json
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from pyotp import TOTP

from app.access.access import Access, prepare
from app.access.audit.search import Filter
from app.access.factors import (
    CODES,
    EARLY,
    ENROLLING_TIME,
    IDENTITY,
    LATE,
    LONGEST_CODE_DELAY,
    MOST_ENROLLING,
    STEP,
    Factors,
)
from app.access.roles import ENROLLING, Person
from app.access.signin import HALF_LIFE, MOST_HALF, HalfIn
from app.access.throttle import FREE_FAILURES
from app.cli_access import terminal
from app.clock import ManualClock
from app.errors import ConfigurationError, Refused, StorageError
from tests.access.conftest import AGENT, PASSWORD, OpenAccess, add, boss, enter, who

ADDRESS = "10.0.0.9"
FILLED = Path(__file__).parent / "filled_0004"
"""What a server left behind whose `pogon.db` was at revision 0004."""
RFC_KEY = base64.b32encode(b"12345678901234567890").decode()


class Phone:
    """What an authenticator shows."""

    def __init__(self, key: str, clock: ManualClock) -> None:
        self.key = key
        self._codes = TOTP(key)
        self._clock = clock

    def shows(self, steps: int = 0) -> str:
        """The code now, or of a telephone whose clock is so many steps ahead."""
        return self._codes.generate_otp(self._clock.micros() // (STEP * 1_000_000) + steps)

    def wrong(self, number: int = 0) -> str:
        """One that is none of the codes near now."""
        near = {self.shows(steps) for steps in range(-3, 4)}
        return [text for text in (f"{value:06}" for value in range(987_000, 988_000)) if text not in near][number]


@pytest.fixture(autouse=True)
def no_rate(access: Access) -> None:
    """These tests are about the throttle of codes, not of addresses."""
    access.throttle.take = lambda _address: True  # type: ignore[method-assign]


def said(caught: pytest.ExceptionInfo[Refused]) -> tuple[str, int]:
    return caught.value.reason, caught.value.status


async def enrol(access: Access, clock: ManualClock, sid: str) -> tuple[Phone, str, list[str]]:
    """The telephone, the new session and the recovery codes."""
    person = await who(access, sid)
    assert person is not None
    phone = Phone(access.factors.begin(person), clock)
    fresh, codes = await access.factors.enrol(person, phone.shows(), AGENT, sid)
    return phone, fresh, codes


async def with_factor(access: Access, clock: ManualClock, name: str = "ana", *roles: str) -> tuple[Phone, list[str]]:
    """Somebody with a second factor, whose last code was some steps ago."""
    await add(access, name, *roles)
    phone, _, codes = await enrol(access, clock, await enter(access, name))
    clock.advance(5 * STEP)
    return phone, codes


async def half_in(access: Access, name: str = "ana", password: str = PASSWORD) -> str:
    """The right password; returns what stands for it."""
    half = await access.sign_in.with_password(name, password, ADDRESS, AGENT)
    assert isinstance(half, HalfIn)
    return half.ticket


async def give(access: Access, ticket: str, code: str) -> Person | None:
    return await who(access, (await access.sign_in.give_code(ticket, code, ADDRESS, AGENT)).sid)


async def refused(access: Access, ticket: str, code: str) -> tuple[str, int]:
    with pytest.raises(Refused) as caught:
        await access.sign_in.give_code(ticket, code, ADDRESS, AGENT)
    return said(caught)


async def lines(access: Access, *kinds: str) -> list[tuple[str, str, str]]:
    """(kind, whose, reason) of these kinds, oldest first."""
    found = await access.audit.find(Filter())
    return [(line.kind, line.object, line.reason) for line in reversed(found) if line.kind in kinds]


# ---- codes ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("time", "code"),
    [
        (59, "287082"),
        (1111111109, "081804"),
        (1111111111, "050471"),
        (1234567890, "005924"),
        (2000000000, "279037"),
        (20000000000, "353130"),
    ],
)
def test_codes_are_those_of_rfc_6238(access: Access, clock: ManualClock, time: int, code: str) -> None:
    clock.step_wall(time - clock.micros() / 1e6)
    assert access.factors._step_of(RFC_KEY, code) == time // STEP
    assert access.factors._step_of(RFC_KEY, f"{(int(code) + 1) % 1_000_000:06}") is None


@pytest.mark.sweep(8)
@pytest.mark.parametrize("steps", range(-5, 6))
async def test_a_code_is_good_one_step_early_or_late(access: Access, clock: ManualClock, steps: int) -> None:
    phone, _ = await with_factor(access, clock)
    ticket = await half_in(access)
    if -LATE <= steps <= EARLY:
        person = await give(access, ticket, phone.shows(steps))
        assert person and person.may("operate")
    else:
        assert await refused(access, ticket, phone.shows(steps)) == ("access.factor.wrong", 401)


@pytest.mark.parametrize(
    "shape", ["{}", " {} ", "{0[0]}{0[1]}{0[2]} {0[3]}{0[4]}{0[5]}", "{0[0]}{0[1]}{0[2]}-{0[3]}{0[4]}{0[5]}"]
)
async def test_a_code_may_be_typed_in_groups(access: Access, clock: ManualClock, shape: str) -> None:
    phone, _ = await with_factor(access, clock)
    assert await give(access, await half_in(access), shape.format(phone.shows()))


async def test_digits_of_a_wide_keyboard_are_digits(access: Access, clock: ManualClock) -> None:
    phone, _ = await with_factor(access, clock)
    wide = "".join(chr(ord(digit) - ord("0") + ord("０")) for digit in phone.shows())
    assert await give(access, await half_in(access), wide)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    "typed",
    [
        "",
        " ",
        "0",
        "00000",
        "0000000",
        "١٢٣٤٥٦",
        "abcdef",
        "-00001",
        "1e5",
        "½½½½½½",
        "x" * 10_000,
        "\0" * 6,
        "AAAA-AAAA-AAAA-AAAA",
        PASSWORD,
    ],
)
async def test_rubbish_is_a_wrong_code_and_nothing_else(access: Access, clock: ManualClock, typed: str) -> None:
    await with_factor(access, clock)
    assert await refused(access, await half_in(access), typed) == ("access.factor.wrong", 401)


# ---- once -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("later", [0.0, 1.0, 29.0, 31.0])
async def test_a_code_is_taken_once(access: Access, clock: ManualClock, later: float) -> None:
    phone, _ = await with_factor(access, clock)
    code = phone.shows(EARLY)
    assert await give(access, await half_in(access), code)
    clock.advance(later)
    assert await refused(access, await half_in(access), code) == ("access.factor.wrong", 401)
    assert (await lines(access, "signin.failed"))[-1][2] == "access.cause.code_replayed"


async def test_after_a_code_none_of_before_it_is_taken(access: Access, clock: ManualClock) -> None:
    phone, _ = await with_factor(access, clock)
    earlier = [phone.shows(steps) for steps in (-1, 0)]
    assert await give(access, await half_in(access), phone.shows(1))
    for code in earlier:
        assert await refused(access, await half_in(access), code) == ("access.factor.wrong", 401)


async def test_the_code_of_the_enrolment_signs_nobody_in(access: Access, clock: ManualClock) -> None:
    await add(access, "ana")
    phone, _, _ = await enrol(access, clock, await enter(access, "ana"))
    assert await refused(access, await half_in(access), phone.shows()) == ("access.factor.wrong", 401)


async def test_a_code_is_taken_once_also_over_a_restart(
    access: Access, open_access: OpenAccess, clock: ManualClock
) -> None:
    phone, _ = await with_factor(access, clock)
    code = phone.shows()
    assert await give(access, await half_in(access), code)
    again = open_access()
    assert await refused(again, await half_in(again), code) == ("access.factor.wrong", 401)
    clock.advance(STEP)
    assert await give(again, await half_in(again), phone.shows())


async def test_a_code_signs_one_of_two_browsers_in(access: Access, clock: ManualClock) -> None:
    phone, _ = await with_factor(access, clock)
    one, other, code = await half_in(access), await half_in(access), phone.shows()
    assert await give(access, one, code)
    assert await refused(access, other, code) == ("access.factor.wrong", 401)


async def test_a_code_of_elsewhere_is_used_up_too(access: Access, clock: ManualClock) -> None:
    phone, _ = await with_factor(access, clock)
    person = await give(access, await half_in(access), phone.shows())
    assert person is not None
    clock.advance(STEP)
    code = phone.shows()
    await access.factors.renew_codes(person, code)
    assert await refused(access, await half_in(access), code) == ("access.factor.wrong", 401)


async def test_a_clock_set_back_makes_no_old_code_good(access: Access, clock: ManualClock) -> None:
    phone, codes = await with_factor(access, clock)
    earlier = phone.shows()
    clock.advance(3600)
    assert await give(access, await half_in(access), phone.shows())
    clock.step_wall(-3600)
    assert await refused(access, await half_in(access), earlier) == ("access.factor.wrong", 401)
    assert await give(access, await half_in(access), codes[0])


# ---- between password and code ----------------------------------------------------------------------------


async def test_the_password_alone_opens_no_session(access: Access, clock: ManualClock) -> None:
    await with_factor(access, clock)
    before = await access.sessions.of()
    ticket = await half_in(access)
    assert await access.sessions.of() == before
    assert await who(access, ticket) is None
    assert ("signin.password", "ana", "") in await lines(access, "signin.password")


async def test_a_wrong_password_says_the_same_with_and_without_factor(access: Access, clock: ManualClock) -> None:
    await with_factor(access, clock)
    await add(access, "ivo")
    answers = set()
    for name in ("ana", "ivo", "nobody"):
        with pytest.raises(Refused) as caught:
            await access.sign_in.with_password(name, "wrong", ADDRESS, AGENT)
        answers.add(said(caught))
    assert answers == {("access.failed", 401)}


@pytest.mark.parametrize("after", [HALF_LIFE, HALF_LIFE + 1])
async def test_the_code_is_waited_for_only_a_while(access: Access, clock: ManualClock, after: float) -> None:
    phone, _ = await with_factor(access, clock)
    ticket = await half_in(access)
    clock.advance(after)
    assert await refused(access, ticket, phone.shows()) == ("access.factor.over", 401)


async def test_it_is_bound_to_the_browser(access: Access, clock: ManualClock) -> None:
    phone, _ = await with_factor(access, clock)
    ticket = await half_in(access)
    with pytest.raises(Refused, match=r"factor\.over"):
        await access.sign_in.give_code(ticket, phone.shows(), ADDRESS, "curl/8")
    assert await give(access, ticket, phone.shows())


@pytest.mark.parametrize("ticket", ["", "x", "A" * 43, "é" * 43, "\0"])
async def test_a_made_up_ticket_is_none(access: Access, clock: ManualClock, ticket: str) -> None:
    phone, codes = await with_factor(access, clock)
    await half_in(access)
    for code in (phone.shows(), codes[0]):
        assert await refused(access, ticket, code) == ("access.factor.over", 401)


async def _disabled(access: Access, key: int) -> None:
    await access.people.disable(boss(), key, True)


async def _other_password(access: Access, key: int) -> None:
    access.people.set_password_now(boss(), "ana", "sedam zelenih biciklista")


async def _initial(access: Access, key: int) -> None:
    await access.people.new_initial(boss(), key)


async def _deleted(access: Access, key: int) -> None:
    await access.people.delete(boss(), key)


async def _factor_reset(access: Access, key: int) -> None:
    await access.factors.reset(boss(), key)


@pytest.mark.parametrize("change", [_disabled, _other_password, _initial, _deleted, _factor_reset])
async def test_what_changes_meanwhile_ends_the_sign_in(
    access: Access, clock: ManualClock, change: Callable[[Access, int], object]
) -> None:
    phone, _ = await with_factor(access, clock)
    key = next(account.id for account in await access.people.all() if account.name == "ana")
    ticket = await half_in(access)
    await change(access, key)  # type: ignore[misc]
    assert await refused(access, ticket, phone.shows()) == ("access.factor.over", 401)
    assert await access.sessions.of(key) == []


async def test_a_ticket_is_good_for_one_session(access: Access, clock: ManualClock) -> None:
    phone, codes = await with_factor(access, clock)
    ticket = await half_in(access)
    assert await give(access, ticket, phone.shows())
    assert await refused(access, ticket, codes[0]) == ("access.factor.over", 401)


async def test_the_session_of_before_stands_until_the_code(access: Access, clock: ManualClock) -> None:
    phone, _ = await with_factor(access, clock)
    old = (await access.sign_in.give_code(await half_in(access), phone.shows(), ADDRESS, AGENT)).sid
    clock.advance(16 * 60)
    half = await access.sign_in.with_password("ana", PASSWORD, ADDRESS, AGENT, old)
    assert isinstance(half, HalfIn)
    idle = await who(access, old)
    assert idle and idle.idle and idle.may("stop")
    fresh = (await access.sign_in.give_code(half.ticket, phone.shows(), ADDRESS, AGENT)).sid
    assert await who(access, old) is None
    assert await who(access, fresh)


@pytest.mark.sweep(8)
async def test_no_more_than_a_number_of_sign_ins_wait(access: Access, clock: ManualClock) -> None:
    await with_factor(access, clock)
    tickets = [await half_in(access) for _ in range(MOST_HALF + 3)]
    assert len(access.sign_in._halves) == MOST_HALF
    assert access.sign_in.half(tickets[-1], AGENT) and not access.sign_in.half(tickets[0], AGENT)


async def test_an_initial_password_is_used_up_by_the_code_and_not_before(access: Access, clock: ManualClock) -> None:
    phone, _ = await with_factor(access, clock)
    key = next(account.id for account in await access.people.all() if account.name == "ana")
    initial = await access.people.new_initial(boss(), key)
    await half_in(access, password=initial)
    person = await give(access, await half_in(access, password=initial), phone.shows())
    assert person and person.must_change and person.permissions == {"account"}
    with pytest.raises(Refused, match="failed"):
        await access.sign_in.with_password("ana", initial, ADDRESS, AGENT)


# ---- guessing ---------------------------------------------------------------------------------------------


async def test_guessing_codes_is_slowed_down_alarmed_and_not_freed_by_the_password(
    access: Access, clock: ManualClock
) -> None:
    told: list[tuple[str, str]] = []
    phone, codes = await with_factor(access, clock)
    access.tell = lambda alarm, name: told.append((alarm, name))
    for number in range(FREE_FAILURES):
        assert await refused(access, await half_in(access), phone.wrong(number)) == ("access.factor.wrong", 401)
    assert told == [("account_locked", "ana")]
    ticket = await half_in(access)  # the right password, once more
    assert await refused(access, ticket, phone.shows()) == ("access.wait", 429)
    assert access.people.locked("ana") > 0
    assert await give(access, ticket, codes[0]), "a recovery code waits for nobody"
    assert access.people.locked("ana") == 0


async def test_the_waits_grow_up_to_a_quarter_of_an_hour(access: Access, clock: ManualClock) -> None:
    phone, _ = await with_factor(access, clock)
    waits = []
    for _ in range(FREE_FAILURES + 14):
        assert await refused(access, await half_in(access), phone.wrong()) == ("access.factor.wrong", 401)
        waits.append(access.factors.locked("ana"))
        clock.advance(waits[-1])
    assert waits[: FREE_FAILURES - 1] == [0.0] * (FREE_FAILURES - 1)
    assert waits == sorted(waits)
    assert waits[-1] == LONGEST_CODE_DELAY


@pytest.mark.parametrize("name", ["ana", "code of ana", "CODE OF ana", "ana code", "CODE OF ANA"])
async def test_a_stranger_at_the_sign_in_cannot_lock_the_codes(access: Access, clock: ManualClock, name: str) -> None:
    phone, _ = await with_factor(access, clock)
    ticket = await half_in(access)
    for _ in range(FREE_FAILURES + 3):
        with pytest.raises(Refused):
            await access.sign_in.with_password(name, "wrong", ADDRESS, AGENT)
    assert await give(access, ticket, phone.shows())


async def test_an_administrator_lets_codes_be_tried_again(access: Access, clock: ManualClock) -> None:
    phone, _ = await with_factor(access, clock)
    key = next(account.id for account in await access.people.all() if account.name == "ana")
    for number in range(FREE_FAILURES + 2):
        with pytest.raises(Refused):
            await access.sign_in.give_code(await half_in(access), phone.wrong(number), ADDRESS, AGENT)
    await access.people.unlock(boss(), key)
    assert await give(access, await half_in(access), phone.shows())


async def test_wrong_codes_are_written_down_and_none_of_them_is_shown(access: Access, clock: ManualClock) -> None:
    phone, codes = await with_factor(access, clock)
    typed = [phone.wrong(), "AAAA-BBBB-CCCC-DDDD"]
    for code in typed:
        await refused(access, await half_in(access), code)
    person = await give(access, await half_in(access), codes[3])
    assert person is not None
    with pytest.raises(Refused, match=r"factor\.wrong"):
        await access.factors.remove(person, typed[0])
    assert await lines(access, "signin.failed", "factor.recovery", "factor.refused") == [
        ("signin.failed", "ana", "access.cause.code_wrong"),
        ("signin.failed", "ana", "access.cause.code_wrong"),
        ("factor.recovery", "ana", ""),
        ("factor.refused", "ana", "access.cause.code_wrong"),
    ]
    text = json.dumps([repr(line) for line in await access.audit.find(Filter())])
    assert not [secret for secret in (*typed, *codes, phone.key) if secret in text or secret.replace("-", "") in text]


# ---- recovery codes ---------------------------------------------------------------------------------------


async def test_ten_recovery_codes_are_each_good_once(access: Access, clock: ManualClock) -> None:
    _, codes = await with_factor(access, clock)
    assert len(set(codes)) == CODES == 10
    for left, code in enumerate(reversed(codes)):
        typed = code.lower() if left % 2 else code.replace("-", " ")
        assert await give(access, await half_in(access), typed)
        assert await refused(access, await half_in(access), code) == ("access.factor.wrong", 401)
        factor = await access.factors.of(1)
        assert factor and factor.recovery == CODES - 1 - left
        access.factors.unlock("ana")


async def test_new_recovery_codes_replace_the_old_ones(access: Access, clock: ManualClock) -> None:
    phone, old = await with_factor(access, clock)
    person = await give(access, await half_in(access), phone.shows())
    assert person is not None
    clock.advance(STEP)
    new = await access.factors.renew_codes(person, phone.shows())
    assert not set(new) & set(old)
    assert await refused(access, await half_in(access), old[0]) == ("access.factor.wrong", 401)
    assert await give(access, await half_in(access), new[0])


async def test_codes_of_somebody_else_are_wrong(access: Access, clock: ManualClock) -> None:
    phone, codes = await with_factor(access, clock, "ana")
    await with_factor(access, clock, "ivo")
    for code in (phone.shows(), codes[0]):
        assert await refused(access, await half_in(access, "ivo"), code) == ("access.factor.wrong", 401)


# ---- turning it on and off --------------------------------------------------------------------------------


async def test_a_key_that_was_only_shown_counts_for_nothing(access: Access) -> None:
    await add(access, "ana")
    person = await who(access, await enter(access, "ana"))
    assert person is not None
    access.factors.begin(person)
    assert await enter(access, "ana")
    assert await access.factors.of(person.id) is None


async def test_enrolling_ends_every_session_that_gave_no_code(access: Access, clock: ManualClock) -> None:
    await add(access, "ana")
    other, mine = await enter(access, "ana"), await enter(access, "ana")
    _, fresh, _ = await enrol(access, clock, mine)
    assert await who(access, other) is None and await who(access, mine) is None
    person = await who(access, fresh)
    assert person and person.may("operate")
    assert await lines(access, "factor.enrolled") == [("factor.enrolled", "ana", "")]


async def test_a_wrong_first_code_turns_nothing_on(access: Access, clock: ManualClock) -> None:
    await add(access, "ana")
    sid = await enter(access, "ana")
    person = await who(access, sid)
    assert person is not None
    phone = Phone(access.factors.begin(person), clock)
    with pytest.raises(Refused) as caught:
        await access.factors.enrol(person, phone.wrong(), AGENT, sid)
    assert said(caught) == ("access.factor.wrong", 401)
    assert await access.factors.of(person.id) is None
    assert access.factors.begun(person) == phone.key
    await access.factors.enrol(person, phone.shows(), AGENT, sid)


async def test_a_shown_key_is_forgotten_after_a_while_and_belongs_to_its_session(
    access: Access, clock: ManualClock
) -> None:
    await add(access, "ana")
    sid, other = await enter(access, "ana"), await enter(access, "ana")
    person, elsewhere = await who(access, sid), await who(access, other)
    assert person and elsewhere
    phone = Phone(access.factors.begin(person), clock)
    with pytest.raises(Refused, match="begin_again"):
        await access.factors.enrol(elsewhere, phone.shows(), AGENT, other)
    clock.advance(ENROLLING_TIME)
    with pytest.raises(Refused, match="begin_again"):
        await access.factors.enrol(person, phone.shows(), AGENT, sid)


async def test_shown_keys_do_not_pile_up(access: Access) -> None:
    for number in range(MOST_ENROLLING + 5):
        access.factors.begin(Person(1, "ana", "", frozenset(), frozenset(), str(number)))
    assert len(access.factors._enrolments) == MOST_ENROLLING


async def test_a_second_enrolment_replaces_nothing(access: Access, clock: ManualClock) -> None:
    phone, _ = await with_factor(access, clock)
    sid = (await access.sign_in.give_code(await half_in(access), phone.shows(), ADDRESS, AGENT)).sid
    person = await who(access, sid)
    assert person is not None
    other = Phone(access.factors.begin(person), clock)
    with pytest.raises(Refused) as caught:
        await access.factors.enrol(person, other.shows(), AGENT, sid)
    assert said(caught) == ("access.factor.already", 409)


@pytest.mark.parametrize("by", ["code", "recovery"])
async def test_it_is_turned_off_with_a_code(access: Access, clock: ManualClock, by: str) -> None:
    phone, codes = await with_factor(access, clock)
    person = await give(access, await half_in(access), phone.shows())
    assert person is not None
    clock.advance(STEP)
    await access.factors.remove(person, phone.shows() if by == "code" else codes[0])
    assert await access.factors.of(person.id) is None
    assert await enter(access, "ana")
    assert await lines(access, "factor.removed") == [("factor.removed", "ana", "")]
    with pytest.raises(Refused) as caught:
        await access.factors.remove(person, codes[1])
    assert said(caught) == ("access.factor.none", 409)


async def test_an_administrator_takes_it_from_others_and_not_from_oneself(access: Access, clock: ManualClock) -> None:
    phone, _ = await with_factor(access, clock, "ana", "admin")
    person = await give(access, await half_in(access), phone.shows())
    ivo = await add(access, "ivo")
    assert person is not None
    with pytest.raises(Refused) as caught:
        await access.factors.reset(person, person.id)
    assert said(caught) == ("access.not_yourself", 409)
    with pytest.raises(Refused) as caught:
        await access.factors.reset(person, ivo)
    assert said(caught) == ("access.factor.none", 409)
    with pytest.raises(Refused) as caught:
        await access.factors.reset(person, 987654)
    assert said(caught) == ("access.no_person", 404)
    _, theirs, _ = await enrol(access, clock, await enter(access, "ivo"))
    await access.factors.reset(person, ivo)
    assert await who(access, theirs) is None
    assert await enter(access, "ivo")
    assert await lines(access, "factor.reset") == [("factor.reset", "ivo", "")]


async def test_the_terminal_takes_it_too_beside_a_running_server(
    access: Access, open_access: OpenAccess, clock: ManualClock
) -> None:
    phone, _ = await with_factor(access, clock)
    person = await give(access, await half_in(access), phone.shows())
    assert person is not None and access.current(person)
    open_access().factors.reset_now(terminal(), " ANA ")
    await access.sessions.renew()
    assert access.current(person) is None
    assert await enter(access, "ana")
    with pytest.raises(Refused, match="no_person"):
        access.factors.reset_now(terminal(), "nobody")


async def test_a_new_password_leaves_the_factor_and_an_account_that_goes_takes_it_along(
    access: Access, clock: ManualClock
) -> None:
    phone, _ = await with_factor(access, clock)
    key = next(account.id for account in await access.people.all() if account.name == "ana")
    access.people.set_password_now(boss(), "ana", "sedam zelenih biciklista")
    assert await give(access, await half_in(access, password="sedam zelenih biciklista"), phone.shows())
    await access.people.delete(boss(), key)
    for table in ("factor", "recovery_code"):
        query = f"SELECT count(*) FROM {table}"
        assert access.people._db.run(lambda c, query=query: c.exec_driver_sql(query).scalar()) == 0  # type: ignore[misc]


async def test_nothing_changes_while_the_audit_cannot_be_written(
    access: Access, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    phone, codes = await with_factor(access, clock)
    person = await give(access, await half_in(access), phone.shows())
    assert person is not None
    monkeypatch.setattr(type(access.audit), "healthy", property(lambda _: False))
    for work in (
        lambda: access.factors.remove(person, codes[0]),
        lambda: access.factors.renew_codes(person, codes[0]),
        lambda: access.factors.enrol(person, codes[0], AGENT, ""),
        lambda: access.factors.reset(boss(), person.id),
    ):
        with pytest.raises(Refused) as caught:
            await work()
        assert said(caught) == ("access.audit_unavailable", 503)
    factor = await access.factors.of(person.id)
    assert factor and factor.recovery == CODES


# ---- who must have one ------------------------------------------------------------------------------------


@pytest.mark.sweep(8)
@pytest.mark.parametrize("roles", [("viewer",), ("operator",), ("engineer",), ("admin",), ("operator", "admin")])
@pytest.mark.parametrize(
    "asked", [set(), {"admin"}, {"engineer", "operator"}, {"viewer", "operator", "engineer", "admin"}]
)
async def test_a_role_that_asks_for_it_leaves_only_enrolling_and_stop(
    access: Access, clock: ManualClock, roles: tuple[str, ...], asked: set[str]
) -> None:
    access.sessions._factor_roles = frozenset(asked)
    await add(access, "ana", *roles)
    sid = await enter(access, "ana")
    before = await who(access, sid)
    assert before is not None
    assert before.must_enrol == bool(set(roles) & asked)
    if before.must_enrol:
        assert before.permissions <= ENROLLING
        assert before.may("stop") == ("operator" in roles or "engineer" in roles)
        current = access.current(before)
        assert current and current.permissions <= ENROLLING
    _, fresh, _ = await enrol(access, clock, sid)
    after = await who(access, fresh)
    assert after and not after.must_enrol and after.may("view") and after.may("account")


async def test_an_initial_password_comes_before_the_factor(access: Access) -> None:
    access.sessions._factor_roles = frozenset({"operator"})
    _, initial = await access.people.add(boss(), "ana", "", ["operator"])
    sid = await enter(access, "ana", initial)
    person = await who(access, sid)
    assert person and person.must_change and not person.must_enrol and person.permissions == {"account"}
    fresh = await access.own.change_password(person, initial, PASSWORD, AGENT, sid)
    person = await who(access, fresh)
    assert person and person.must_enrol and person.permissions == ENROLLING


async def test_a_role_given_or_a_factor_taken_counts_in_open_sessions_at_once(
    access: Access, clock: ManualClock
) -> None:
    access.sessions._factor_roles = frozenset({"engineer"})
    key = await add(access, "ana", "operator")
    person = await who(access, await enter(access, "ana"))
    assert person and not person.must_enrol
    told: list[str] = []
    access.sessions.subscribe_changes(told.extend)
    await access.people.set_roles(boss(), key, ["operator", "engineer"])
    assert told == [person.session]
    now = access.current(person)
    assert now and now.must_enrol and now.permissions == ENROLLING
    sid = await enter(access, "ana")
    _, fresh, codes = await enrol(access, clock, sid)
    person = await who(access, fresh)
    assert person and person.may("configure")
    await access.factors.remove(person, codes[0])
    now = access.current(person)
    assert now and now.must_enrol and now.permissions == ENROLLING


async def test_a_program_goes_on_while_its_maker_enrols(access: Access) -> None:
    await add(access, "ana", "engineer")
    person = await who(access, await enter(access, "ana"))
    assert person is not None
    _, secret = await access.tokens.create(person, "MES", ["view", "operate"], 7)
    access.sessions._factor_roles = frozenset({"engineer"})
    program = await access.tokens.find(secret)
    assert program and program.permissions == {"view", "operate"} and not program.must_enrol


# ---- what is kept where -----------------------------------------------------------------------------------


async def test_the_database_has_no_key_and_no_recovery_code(access: Access, clock: ManualClock, data: Path) -> None:
    phone, codes = await with_factor(access, clock)
    files = {path.name: path.read_bytes() for path in data.iterdir()}  # noqa: ASYNC240
    shown = [phone.key, *codes, *(code.replace("-", "") for code in codes)]
    secrets = [base64.b32decode(phone.key), *(text.encode() for text in shown)]
    assert [(name, secret) for name, content in files.items() for secret in secrets if secret in content] == []
    assert (data / IDENTITY).stat().st_mode & 0o777 == 0o600


async def test_a_row_moved_to_another_person_opens_nothing(access: Access, clock: ManualClock, data: Path) -> None:
    phone, _ = await with_factor(access, clock, "ana")
    await with_factor(access, clock, "ivo")
    access.people._db.run(
        lambda c: c.exec_driver_sql("UPDATE factor SET sealed = (SELECT sealed FROM factor WHERE person = 1)") and None
    )
    assert await refused(access, await half_in(access, "ivo"), phone.shows()) == ("access.factor.wrong", 401)
    assert (await lines(access, "signin.failed"))[-1][2] == "access.cause.code_unreadable"
    assert await give(access, await half_in(access, "ana"), phone.shows())


@pytest.mark.parametrize("sealed", ["", "x", "é", "AAAA", base64.b64encode(b"age-encryption.org/v1\n").decode()])
async def test_a_broken_row_is_a_code_that_is_not_taken(access: Access, clock: ManualClock, sealed: str) -> None:
    phone, codes = await with_factor(access, clock)
    access.people._db.run(lambda c: c.exec_driver_sql("UPDATE factor SET sealed = ?", (sealed,)) and None)
    assert await refused(access, await half_in(access), phone.shows()) == ("access.factor.wrong", 401)
    assert await give(access, await half_in(access), codes[0])


async def test_without_its_identity_only_recovery_codes_are_taken_and_the_log_says_so(
    access: Access, open_access: OpenAccess, clock: ManualClock, data: Path, caplog: pytest.LogCaptureFixture
) -> None:
    phone, codes = await with_factor(access, clock)
    (data / IDENTITY).unlink()
    again = open_access()
    await again.start()
    assert "second factors cannot be checked" in caplog.text
    assert await refused(again, await half_in(again), phone.shows()) == ("access.factor.wrong", 401)
    person = await give(again, await half_in(again), codes[0])
    assert person is not None
    await again.factors.remove(person, codes[1])
    fresh, _, _ = await enrol(again, clock, await enter(again, "ana"))
    clock.advance(2 * STEP)
    assert await give(again, await half_in(again), fresh.shows())


@pytest.mark.parametrize("text", ["", "hello", "AGE-SECRET-KEY-1QQQ"])
async def test_a_broken_identity_is_not_replaced(access: Access, clock: ManualClock, data: Path, text: str) -> None:
    (data / IDENTITY).write_text(text)
    await add(access, "ana")
    with pytest.raises(Refused) as caught:
        await enrol(access, clock, await enter(access, "ana"))
    assert said(caught) == ("error.unavailable", 503)
    assert (data / IDENTITY).read_text() == text


async def test_an_identity_that_vanishes_under_the_server_is_written_again(
    access: Access, open_access: OpenAccess, clock: ManualClock, data: Path
) -> None:
    phone, _ = await with_factor(access, clock, "ana")
    (data / IDENTITY).unlink()
    await with_factor(access, clock, "ivo")
    again = open_access()
    assert await give(again, await half_in(again, "ana"), phone.shows())


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o666])
async def test_an_identity_that_others_may_read_stops_the_start(
    access: Access, clock: ManualClock, data: Path, mode: int
) -> None:
    await with_factor(access, clock)
    (data / IDENTITY).chmod(mode)
    with pytest.raises(ConfigurationError, match=r"factor\.identity"):
        prepare(data)


async def test_a_database_that_takes_nothing_signs_nobody_in(
    access: Access, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    phone, _ = await with_factor(access, clock)
    ticket, code = await half_in(access), phone.shows()

    async def full(*_: object) -> object:
        raise StorageError("disk full")

    with monkeypatch.context() as broken:
        broken.setattr(access.audit, "with_entries", full)
        with pytest.raises(StorageError):
            await access.sign_in.give_code(ticket, code, ADDRESS, AGENT)
    assert await give(access, ticket, code), "the code was not used up"


# ---- a database of before ---------------------------------------------------------------------------------


@pytest.fixture
def filled(tmp_path: Path) -> Path:
    """A data folder as the version before left it."""
    folder = tmp_path / "filled"
    folder.mkdir(mode=0o700)
    with closing(sqlite3.connect(folder / "pogon.db")) as connection, connection:
        connection.executescript((FILLED / "pogon.sql").read_text("utf-8"))
    connection.close()
    for name in ("audit.key", "audit.head", "audit.anchors", "secret.key"):
        shutil.copyfile(FILLED / name, folder / name)
    for path in folder.iterdir():
        path.chmod(0o600)
    return folder


async def test_a_database_of_before_loses_nothing_and_takes_factors(
    filled: Path, open_access: OpenAccess, clock: ManualClock
) -> None:
    known = json.loads((FILLED / "known.json").read_text())
    tables = ("person", "person_role", "session", "token", "audit")
    with closing(sqlite3.connect(filled / "pogon.db")) as before, before:
        rows = {table: before.execute(f"SELECT * FROM {table}").fetchall() for table in tables}
        assert before.execute("SELECT version_num FROM alembic_version").fetchall() == [("0004",)]
    before.close()
    clock.advance(120)
    access = open_access(filled)
    access.people._db.migrate()
    with closing(sqlite3.connect(filled / "pogon.db")) as after, after:
        assert {table: after.execute(f"SELECT * FROM {table}").fetchall() for table in tables} == rows
        assert after.execute("PRAGMA foreign_key_check").fetchall() == []
    after.close()
    assert access.audit.check_now().ok
    assert await access.start() == ""
    assert [(a.name, sorted(a.roles), a.disabled, a.factor) for a in await access.people.all()] == [
        ("ana", ["admin", "engineer", "operator"], False, False),
        ("eve", ["viewer"], True, False),
        ("ivo", ["operator"], False, False),
        ("nov", ["engineer"], False, False),
    ]
    person = await who(access, known["ana"])
    assert person and person.may("administer")
    assert await access.tokens.find(known["token"])
    assert await enter(access, "ivo", address="10.0.0.8")
    phone, _, _ = await enrol(access, clock, known["ana"])
    clock.advance(STEP)
    assert await give(access, await half_in(access, "ana"), phone.shows())
    assert access.audit.check_now().ok


def test_the_factor_belongs_to_the_people_of_this_server(access: Access) -> None:
    assert isinstance(access.factors, Factors)
