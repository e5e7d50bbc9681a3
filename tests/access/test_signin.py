"""Letting people in: the first account, passwords, what is said of a failure, and how guessing is slowed down."""

import asyncio
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from pwdlib.hashers.argon2 import Argon2Hasher

from app.access.access import Access
from app.access.audit.search import Filter
from app.access.passwords import Cost
from app.access.sessions import hash_of
from app.access.throttle import BUCKET
from app.clock import ManualClock
from app.errors import Refused, StorageError
from tests.access.conftest import AGENT, PASSWORD, OpenAccess, add, boss, enter, who
from tests.access.refusals import reason

COMMON_PAIRS = [
    (name, password)
    for name in ("admin", "administrator", "root", "user", "operator", "engineer", "system", "guest", "pogon", "scada")
    for password in (
        "",
        "admin",
        "password",
        "1234",
        "12345678",
        "pogon",
        "operator",
        "changeme",
        "root",
        "scada123",
        "system",
        "guest",
    )
]


@pytest.fixture
def slow(access: Access, monkeypatch: pytest.MonkeyPatch) -> asyncio.Event:
    """Passwords are looked at when this is set."""
    begun, verify = asyncio.Event(), access.passwords.verify

    async def after(password: str, kept: str | None) -> bool:
        await begun.wait()
        return await verify(password, kept)

    monkeypatch.setattr(access.passwords, "verify", after)
    return begun


async def test_a_fresh_installation_lets_nobody_in(access: Access, clock: ManualClock) -> None:
    await access.start()
    assert await access.people.count() == 0
    for name, password in COMMON_PAIRS:
        clock.advance(61)
        with pytest.raises(Refused) as caught:
            await enter(access, name, password)
        assert reason(caught) == ("access.failed", 401)


async def test_the_code_makes_one_account_that_may_do_everything_and_is_then_gone(access: Access, data: Path) -> None:
    code = await access.start()
    file = data / "first-code"
    assert file.read_text().strip() == code
    assert file.stat().st_mode & 0o777 == 0o600
    made = await access.sign_in.first(code.lower().replace("-", " "), "Ana.Kos", "Ana Kos", PASSWORD, "10.0.0.9", AGENT)
    assert made.account.roles == {"admin", "engineer", "operator"}
    assert made.account.name == "ana.kos"
    person = await who(access, made.sid)
    assert person and person.may("administer") and person.may("operate") and person.may("configure")
    assert not file.exists()
    with pytest.raises(Refused) as caught:
        await access.sign_in.first(code, "eve", "", PASSWORD, "10.0.0.9", AGENT)
    assert reason(caught) == ("access.first_done", 409)


async def test_every_start_has_another_code_until_there_is_an_account(open_access: OpenAccess) -> None:
    first, second = await open_access().start(), await open_access().start()
    assert first and second and first != second
    access = open_access()
    code = await access.start()
    await access.sign_in.first(code, "ana", "", PASSWORD, "10.0.0.9", AGENT)
    assert await open_access().start() == ""


async def test_guessing_the_code_is_slowed_down(access: Access, clock: ManualClock) -> None:
    code = await access.start()
    for number in range(5):
        with pytest.raises(Refused, match=r"access\.code_wrong"):
            await access.sign_in.first(f"AAAA-AAAA-AAAA-AAA{number}", "ana", "", PASSWORD, "10.0.0.9", AGENT)
    with pytest.raises(Refused) as caught:
        await access.sign_in.first(code, "ana", "", PASSWORD, "10.0.0.9", AGENT)
    assert reason(caught) == ("access.wait", 429)
    clock.advance(2)
    assert (await access.sign_in.first(code, "ana", "", PASSWORD, "10.0.0.9", AGENT)).account.name == "ana"


async def test_a_weak_password_does_not_use_the_code_up(access: Access) -> None:
    code = await access.start()
    with pytest.raises(Refused, match="short"):
        await access.sign_in.first(code, "ana", "", "short", "10.0.0.9", AGENT)
    assert (await access.sign_in.first(code, "ana", "", PASSWORD, "10.0.0.9", AGENT)).sid


async def test_the_right_password_opens_a_session(access: Access) -> None:
    await add(access, "ana", "operator")
    person = await who(access, await enter(access, "  ANA "))
    assert person is not None
    assert (person.name, person.roles) == ("ana", {"operator"})


async def test_every_cause_of_failure_has_the_same_text(access: Access, clock: ManualClock) -> None:
    await add(access, "ana")
    disabled = await add(access, "marko")
    await access.people.disable(boss(), disabled, True)
    await access.people.add(boss(), "late", "", ["operator"])
    clock.advance(25 * 3600)
    said = set()
    for name, password in (("ana", "wrong"), ("nobody", "wrong"), ("marko", PASSWORD), ("late", "wrong"), ("ana", "")):
        with pytest.raises(Refused) as caught:
            await enter(access, name, password)
        said.add((*reason(caught), tuple(caught.value.params)))
    assert said == {("access.failed", 401, ())}


@pytest.mark.sweep(8)
async def test_an_unknown_name_costs_the_same_hash_as_a_wrong_password(
    open_access: OpenAccess, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    access = open_access(cost=Cost(passes=2, memory=128, lanes=1))
    await add(access, "ana")
    checked: list[tuple[str, str]] = []
    verify = Argon2Hasher.verify

    def watched(self: Argon2Hasher, password: str, kept: str) -> bool:
        checked.append((password, kept.rsplit("$", 2)[0]))
        return verify(self, password, kept)

    monkeypatch.setattr(Argon2Hasher, "verify", watched)
    for name in ("ana", "nobody"):
        clock.advance(3700)
        with pytest.raises(Refused):
            await enter(access, name, "wrong password")
    assert checked == [("wrong password", "$argon2id$v=19$m=128,t=2,p=1")] * 2


async def test_six_wrong_passwords_delay_also_the_right_one_and_nobody_else(access: Access, clock: ManualClock) -> None:
    await add(access, "ana")
    await add(access, "marko")
    open_session = await enter(access, "ana")
    for _ in range(6):
        with pytest.raises(Refused):
            await enter(access, "ana", "wrong")
        clock.advance(access.people.locked("ana") if _ < 5 else 0)
    assert access.people.locked("ana") == pytest.approx(2)
    with pytest.raises(Refused) as caught:
        await enter(access, "ana")
    assert reason(caught) == ("access.failed", 401)
    assert await enter(access, "marko")
    assert await who(access, open_session) is not None
    clock.advance(2.1)
    assert await enter(access, "ana")
    lines = await access.audit.find(Filter(kind="signin.failed"))
    assert len(lines) == 7
    assert lines[0].reason == "access.cause.locked"


async def test_an_address_cannot_try_more_than_twenty_a_minute(access: Access) -> None:
    said = []
    for number in range(25):
        with pytest.raises(Refused) as caught:
            await enter(access, f"name{number}", "wrong")
        said.append(caught.value.status)
    assert said == [401] * 20 + [429] * 5


async def test_a_class_behind_one_address_signs_in_at_once_and_leaves_no_more_guesses(access: Access) -> None:
    await add(access, "ana")
    await add(access, "marko")
    for _ in range(15):
        assert await enter(access, "ana")
        assert await enter(access, "marko")
    said = []
    for number in range(22):
        with pytest.raises(Refused) as caught:
            await enter(access, f"name{number}", "wrong")
        said.append(caught.value.status)
    assert said == [401] * 20 + [429] * 2


@pytest.mark.sweep(8)
async def test_a_class_behind_one_address_signs_in_at_the_same_moment(access: Access, slow: asyncio.Event) -> None:
    class_ = [f"student{number}" for number in range(BUCKET + 11)]
    for name in class_:
        await add(access, name)
    entering = asyncio.gather(*(enter(access, name) for name in class_))
    await asyncio.sleep(1)
    slow.set()
    assert len(set(await entering)) == len(class_)
    assert len(access.sign_in._attempts) == 0


async def test_side_by_side_an_address_has_no_more_guesses(access: Access, slow: asyncio.Event) -> None:
    await add(access, "ana")
    guesses = [enter(access, f"name{number}", "wrong") for number in range(BUCKET + 4)]
    entering = asyncio.gather(enter(access, "ana"), *guesses, enter(access, "ana"), return_exceptions=True)
    await asyncio.sleep(1)
    slow.set()
    said = [one.status if isinstance(one, Refused) else 303 for one in await entering]
    assert said == [303] + [401] * BUCKET + [429] * 5


async def test_who_waits_in_line_is_told_after_a_while(access: Access, slow: asyncio.Event) -> None:
    asked = [asyncio.create_task(enter(access, f"name{number}", "wrong")) for number in range(BUCKET)]
    await asyncio.sleep(1)
    with pytest.raises(Refused) as caught:
        await enter(access, "ana")
    assert reason(caught) == ("access.too_many", 429)
    elsewhere = asyncio.create_task(access.sign_in.with_password("ana", "wrong", "192.0.2.9", AGENT))
    slow.set()
    for one in [*asked, elsewhere]:
        with pytest.raises(Refused) as caught:
            await one
        assert reason(caught) == ("access.failed", 401)


async def test_an_old_hash_is_renewed_when_its_owner_signs_in(open_access: OpenAccess, data: Path) -> None:
    await add(open_access(), "ana")
    access = open_access(cost=Cost(passes=2, memory=64, lanes=1))
    await enter(access, "ana")
    with closing(sqlite3.connect(data / "pogon.db")) as db, db:
        assert ",t=2," in db.execute("select password from person").fetchone()[0]
    db.close()
    assert await enter(access, "ana")


async def test_an_initial_password_is_good_once_and_only_for_choosing_another(access: Access) -> None:
    _, initial = await access.people.add(boss(), "marko", "Marko Babić", ["operator"])
    sid = await enter(access, "marko", initial)
    person = await who(access, sid)
    assert person and person.must_change
    assert person.permissions == {"account"}
    with pytest.raises(Refused):
        await enter(access, "marko", initial)
    fresh = await access.own.change_password(person, initial, PASSWORD, AGENT, sid)
    assert await who(access, sid) is None
    changed = await who(access, fresh)
    assert changed and changed.may("operate") and not changed.must_change


async def test_an_initial_password_is_dead_after_a_day(access: Access, clock: ManualClock) -> None:
    _, initial = await access.people.add(boss(), "marko", "", ["operator"])
    clock.advance(24 * 3600 + 1)
    with pytest.raises(Refused, match=r"access\.failed"):
        await enter(access, "marko", initial)


async def test_unknown_names_lock_without_an_alarm(access: Access) -> None:
    told: list[tuple[str, str]] = []
    access.tell = lambda alarm, name: told.append((alarm, name))
    for _ in range(8):
        with pytest.raises(Refused):
            await enter(access, "nobody", "wrong wrong wrong")
    assert told == []


# ---- a database that takes nothing ------------------------------------------------------------------------

TABLES = ("session", "audit")


def fill(access: Access) -> None:
    """From now on the disk is full: nothing is taken of a sign-in."""
    for table in TABLES:
        full = f"CREATE TRIGGER full_{table} BEFORE INSERT ON {table} BEGIN SELECT RAISE(ABORT, 'database or disk is full'); END"
        access.sessions._db.run(lambda connection: connection.exec_driver_sql(full) and None)  # noqa: B023


def empty(access: Access) -> None:
    """It has room again."""
    for table in TABLES:
        access.sessions._db.run(lambda connection: connection.exec_driver_sql(f"DROP TRIGGER full_{table}") and None)  # noqa: B023


async def test_a_full_disk_keeps_no_operator_out_and_all_of_it_is_written_when_it_has_room(
    access: Access, open_access: OpenAccess
) -> None:
    key = await add(access, "ana", "operator")
    fill(access)
    sid = await enter(access, "ana")
    person = await who(access, sid)
    assert person is not None and person.may("stop") and person.may("operate")
    assert access.sessions.current(person) is not None
    assert [one.id_hash for one in await access.sessions.of(key)] == [hash_of(sid)]
    assert await who(open_access(), sid) is None, "it is nowhere but in this server"
    await access.sessions.renew()
    assert await who(access, sid) is not None
    with pytest.raises(StorageError):
        await access.sessions.standing.write()
    empty(access)
    await access.sessions.standing.write()
    await access.audit.replay()
    assert await who(access, sid) is not None
    assert len(await access.sessions.of(key)) == 1
    assert await who(open_access(), sid) is not None
    (line,) = await access.audit.find(Filter(kind="signin.ok"))
    assert (line.person, line.result, "buffered" in line.params) == ("ana", "ok", True)
    assert (await access.audit.check()).ok


async def test_on_a_full_disk_wrong_passwords_and_who_may_not_come_in_stay_out(access: Access) -> None:
    await add(access, "ana")
    off = await add(access, "ivo")
    await access.people.disable(boss(), off, True)
    _, initial = await access.people.add(boss(), "late", "", ["operator"])
    fill(access)
    for name, password in (("ana", "wrong"), ("ivo", PASSWORD), ("nobody", PASSWORD)):
        with pytest.raises(Refused, match=r"access\.failed"):
            await enter(access, name, password)
    with pytest.raises(StorageError):
        await enter(access, "late", initial)
    empty(access)
    assert await enter(access, "late", initial), "it was not used up"


async def test_where_not_even_a_line_of_the_audit_has_room_one_watches_and_stops(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def nowhere(_entry: object) -> bool:
        return False

    await add(access, "ana", "operator")
    fill(access)
    monkeypatch.setattr(access.audit, "foretell", nowhere)
    sid = await enter(access, "ana")
    person = await who(access, sid)
    assert person is not None and person.may("stop") and not person.may("operate")
    empty(access)
    await access.sessions.standing.write()
    await access.audit.replay()
    person = await who(access, sid)
    assert person is not None and person.may("operate")
    assert [line.person for line in await access.audit.find(Filter(kind="signin.ok"))] == ["ana"]


async def test_a_session_that_stands_in_memory_ends_as_others_do(access: Access, open_access: OpenAccess) -> None:
    key = await add(access, "ana", "operator")
    fill(access)
    first = await enter(access, "ana")
    for _ in range(3):
        newest = await enter(access, "ana")
    assert await who(access, first) is None, "three at once are enough"
    person = await who(access, newest)
    assert person is not None
    with pytest.raises(StorageError):
        await access.sessions.end(person, person.session, "signout")
    assert await who(access, newest) is None
    last = await enter(access, "ana")
    empty(access)
    open_access().people.set_password_now(boss(), "ana", "sasvim druga dobra lozinka")
    assert await who(access, last) is None, "the password is another one"
    await access.sessions.standing.write()
    await access.sessions.write_ends()
    assert await access.sessions.of(key) == []
    assert [line.kind for line in await access.audit.find(Filter(kind="signout"))] == ["signout"]


async def test_a_session_that_was_replaced_on_a_full_disk_is_none_after_a_restart_either(
    access: Access, open_access: OpenAccess
) -> None:
    """The database went on having it: whoever kept its cookie was in again once the server was started anew."""
    await add(access, "ana", "operator")
    before = await enter(access, "ana")
    fill(access)
    after = (await access.sign_in.with_password("ana", PASSWORD, "10.0.0.9", AGENT, before)).sid
    assert await who(access, before) is None
    empty(access)
    await access.sessions.standing.write()
    await access.sessions.write_ends()
    restarted = open_access()
    assert await who(restarted, before) is None
    assert await who(restarted, after) is not None
