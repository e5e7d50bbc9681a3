"""What goes on without requests follows the rights of its person: every way in which one can end, here or in another process."""

from collections.abc import Awaitable, Callable

import pytest

from app.access.access import Access
from app.access.roles import Person
from app.access.session_times import IDLE_AFTER, SHIFT
from app.access.sessions import MOST_FAILURES
from app.clock import ManualClock
from app.errors import StorageError
from tests.access.conftest import OpenAccess, add, boss, enter, who

Way = Callable[[Access, Person, ManualClock], Awaitable[None]]


async def _disable(access: Access, person: Person, clock: ManualClock) -> None:
    await access.people.disable(boss(), person.id, True)


async def _delete(access: Access, person: Person, clock: ManualClock) -> None:
    await access.people.delete(boss(), person.id)


async def _reset(access: Access, person: Person, clock: ManualClock) -> None:
    await access.people.new_initial(boss(), person.id)


async def _end(access: Access, person: Person, clock: ManualClock) -> None:
    await access.sessions.end(boss(), person.session)


async def _demote(access: Access, person: Person, clock: ManualClock) -> None:
    await access.people.set_roles(boss(), person.id, ["viewer"])


async def _crowd_out(access: Access, person: Person, clock: ManualClock) -> None:
    for _ in range(3):
        clock.advance(1)
        await enter(access, person.name)


async def _demote_in_terminal(access: Access, person: Person, clock: ManualClock) -> None:
    access.people.set_roles_now(boss(), person.name, ["viewer"])


async def _reset_in_terminal(access: Access, person: Person, clock: ManualClock) -> None:
    access.people.set_password_now(boss(), person.name, None)


async def _expire(access: Access, person: Person, clock: ManualClock) -> None:
    clock.advance(SHIFT)


async def _idle(access: Access, person: Person, clock: ManualClock) -> None:
    clock.advance(IDLE_AFTER)


HERE: dict[str, Way] = {
    "disabled": _disable,
    "deleted": _delete,
    "password reset": _reset,
    "session ended": _end,
    "role taken": _demote,
    "too many sessions": _crowd_out,
    "end of the shift": _expire,
    "idle": _idle,
}
THERE: dict[str, Way] = {**HERE, "role taken in the terminal": _demote_in_terminal, "reset there": _reset_in_terminal}
"""Done by another process on the same files."""
OVER = {
    "disabled",
    "deleted",
    "password reset",
    "session ended",
    "too many sessions",
    "end of the shift",
    "reset there",
}


class Told:
    def __init__(self, access: Access) -> None:
        self.ended: list[str] = []
        self.changed: list[str] = []
        access.subscribe(self.ended.extend, self.changed.extend)


@pytest.mark.parametrize("way", HERE)
async def test_a_right_that_ends_here_is_known_at_once(access: Access, clock: ManualClock, way: str) -> None:
    await add(access, "oli", "operator")
    person = await who(access, await enter(access, "oli"))
    assert person is not None
    told = Told(access)
    await HERE[way](access, person, clock)
    now = access.current(person)
    assert now is None or not now.may("operate")
    if way in OVER:
        assert now is None
        if way != "end of the shift":
            assert told.ended == [person.session]
    elif way == "role taken":
        assert told.changed == [person.session]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("way", THERE)
async def test_a_right_that_ends_elsewhere_is_known_after_one_look(
    open_access: OpenAccess, clock: ManualClock, way: str
) -> None:
    server, terminal = open_access(), open_access()
    await add(server, "oli", "operator")
    person = await who(server, await enter(server, "oli"))
    assert person is not None
    assert server.current(person) == person
    told = Told(server)
    await THERE[way](terminal, person, clock)
    await server.sessions.renew()
    now = server.current(person)
    assert now is None or not now.may("operate")
    if way in OVER:
        assert now is None
        assert told.ended == [person.session]
    elif way != "idle":
        assert told.changed == [person.session]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("way", THERE)
async def test_it_is_told_once_also_when_a_page_is_asked_for_before_that_look(
    open_access: OpenAccess, clock: ManualClock, way: str
) -> None:
    server, terminal = open_access(), open_access()
    await add(server, "oli", "operator")
    sid = await enter(server, "oli")
    person = await who(server, sid)
    assert person is not None
    told = Told(server)
    await THERE[way](terminal, person, clock)
    await who(server, sid)
    await server.sessions.renew()
    assert told.ended == ([person.session] if way in OVER else [])
    assert told.changed == ([person.session] if way not in OVER and way != "idle" else [])


async def test_a_right_that_comes_is_known_too(open_access: OpenAccess) -> None:
    server, terminal = open_access(), open_access()
    await add(server, "vit", "viewer")
    person = await who(server, await enter(server, "vit"))
    assert person is not None
    terminal.people.set_roles_now(boss(), "vit", ["operator"])
    await server.sessions.renew()
    now = server.current(person)
    assert now is not None
    assert now.may("operate")


async def test_nobody_is_read_when_nobody_is_there(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise AssertionError("the database was asked")

    monkeypatch.setattr(access.sessions._db, "read", fail)
    monkeypatch.setattr(access.tokens._db, "read", fail)
    await access.sessions.renew()
    await access.tokens.renew()


async def test_what_was_read_before_a_change_does_not_undo_it(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    await add(access, "oli", "operator")
    person = await who(access, await enter(access, "oli"))
    assert person is not None
    real = access.sessions._db.read

    async def slow(work: object) -> object:
        found = await real(work)  # type: ignore[arg-type]
        monkeypatch.undo()
        await access.people.set_roles(boss(), person.id, ["viewer"])
        return found

    monkeypatch.setattr(access.sessions._db, "read", slow)
    await access.sessions.renew()
    now = access.current(person)
    assert now is not None
    assert not now.may("operate")


async def test_while_the_database_cannot_be_read_for_long_nobody_acts(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    await add(access, "oli", "operator")
    person = await who(access, await enter(access, "oli"))
    assert person is not None
    told = Told(access)

    async def fail(*_: object) -> None:
        raise StorageError("gone")

    monkeypatch.setattr(access.sessions._db, "read", fail)
    for _ in range(MOST_FAILURES - 1):
        await access.sessions.renew()
    assert access.current(person) == person
    await access.sessions.renew()
    now = access.current(person)
    assert now is not None
    assert not now.may("operate")
    assert now.may("stop")
    assert told.changed == [person.session]
    monkeypatch.undo()
    await access.sessions.renew()
    assert access.current(person) == person


@pytest.mark.parametrize("way", ["revoked", "reset", "disabled", "role taken", "reset in the terminal"])
async def test_a_token_ends_with_its_maker_too(open_access: OpenAccess, way: str) -> None:
    access, terminal = open_access(), open_access()
    await add(access, "eva", "engineer")
    eva = await who(access, await enter(access, "eva"))
    assert eva is not None
    token, secret = await access.tokens.create(eva, "script", ["view", "operate"], 30)
    person = await access.tokens.find(secret, "10.0.0.5")
    assert person is not None
    assert access.current(person) == person
    told = Told(access)
    match way:
        case "revoked":
            await access.tokens.revoke(eva, token.id)
        case "reset":
            await access.people.new_initial(boss(), eva.id)
        case "disabled":
            await access.people.disable(boss(), eva.id, True)
        case "role taken":
            await access.people.set_roles(boss(), eva.id, ["viewer"])
        case _:
            terminal.people.set_password_now(boss(), "eva", None)
            await access.tokens.renew()
    now = access.current(person)
    assert now is None or not now.may("operate")
    assert person.session in told.changed
    if way.startswith("reset"):
        access.people.set_password_now(boss(), "eva", "a new one, longer than before")
        assert await access.tokens.find(secret) is None  # also when the password is set anew


async def test_ones_own_new_password_leaves_ones_tokens(access: Access) -> None:
    await add(access, "eva", "engineer")
    sid = await enter(access, "eva")
    eva = await who(access, sid)
    assert eva is not None
    _, secret = await access.tokens.create(eva, "script", ["view"], 30)
    await access.own.change_password(eva, "tri plave ladice u kutu", "sedam zelenih ormara iza", "x", sid)
    assert await access.tokens.find(secret) is not None
