"""Sessions: random, rotated, limited, idle, over; and alive after a restart."""

import re
import shutil
from pathlib import Path

import pytest
from sqlalchemy import event

from app import chance
from app.access.access import Access, prepare
from app.access.session_times import IDLE_AFTER
from app.access.sessions import ID_BYTES, family, hash_of
from app.clock import ManualClock
from app.errors import Refused, StorageError
from tests.access.conftest import AGENT, PASSWORD, OpenAccess, add, boss, enter, who


async def test_ids_have_256_bits_and_only_their_hash_is_kept(access: Access, data: Path) -> None:
    await add(access, "ana")
    sid = await enter(access, "ana")
    assert re.fullmatch(r"[\w-]{43}", sid)
    (session,) = await access.sessions.of()
    assert session.id_hash == hash_of(sid)


def test_ten_thousand_ids_are_all_different() -> None:
    assert ID_BYTES == 32
    assert len({chance.token_urlsafe(ID_BYTES) for _ in range(10_000)}) == 10_000


async def test_signing_in_again_replaces_the_session_that_the_browser_had(access: Access) -> None:
    await add(access, "ana")
    old = await enter(access, "ana")
    new = await enter(access, "ana", old=old)
    assert new != old
    assert await who(access, old) is None
    assert await who(access, new) is not None


async def test_sessions_survive_a_restart_and_another_installation_knows_none_of_them(
    open_access: OpenAccess, tmp_path: Path, empty_database: Path
) -> None:
    access = open_access()
    await add(access, "ana")
    sid = await enter(access, "ana")
    assert await who(open_access(), sid) is not None
    elsewhere = open_access(installation(tmp_path / "other", empty_database))
    await add(elsewhere, "ana")
    assert await who(elsewhere, sid) is None
    token = access.form_token(sid)
    assert access.is_form_token(token, sid)
    assert not elsewhere.is_form_token(token, sid)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    "forged", ["", "x", "a" * 43, "eyJhbGciOiJub25lIn0.eyJzdWIiOjF9.", "' OR 1=1--", "ж" * 43, "a" * 10_000]
)
async def test_a_forged_id_is_nobody(access: Access, forged: str) -> None:
    await add(access, "ana")
    await enter(access, "ana")
    assert await who(access, forged) is None


# ---- idling -----------------------------------------------------------------------------------------------


async def test_after_fifteen_minutes_an_operator_only_watches_and_may_stop(access: Access, clock: ManualClock) -> None:
    await add(access, "ana", "operator")
    sid = await enter(access, "ana")
    clock.advance(IDLE_AFTER - 1)
    person = await who(access, sid)
    assert person and not person.idle and person.idle_in == pytest.approx(1)
    clock.advance(1)
    person = await who(access, sid)
    assert person and person.idle
    assert person.permissions == {"view", "account", "stop"}


async def test_a_deed_starts_the_time_anew_but_does_not_wake_an_idle_session(
    access: Access, clock: ManualClock
) -> None:
    await add(access, "ana", "operator")
    sid = await enter(access, "ana")
    for _ in range(4):
        clock.advance(IDLE_AFTER - 5)
        person = await who(access, sid)
        assert person and not person.idle
        access.sessions.touch(person)
    clock.advance(IDLE_AFTER + 1)
    person = await who(access, sid)
    assert person and person.idle
    access.sessions.touch(person)
    assert (await who(access, sid)).idle  # type: ignore[union-attr]
    fresh = await enter(access, "ana", old=sid)
    assert not (await who(access, fresh)).idle  # type: ignore[union-attr]
    assert await who(access, sid) is None


async def test_a_viewer_goes_on_watching(access: Access, clock: ManualClock) -> None:
    await add(access, "panel", "viewer")
    sid = await enter(access, "panel")
    clock.advance(20 * 86_400)
    person = await who(access, sid)
    assert person and not person.idle and person.may("view")


@pytest.mark.parametrize(("role", "hours"), [("operator", 12), ("engineer", 8), ("admin", 8)])
async def test_a_session_ends_with_the_shift(access: Access, clock: ManualClock, role: str, hours: int) -> None:
    await add(access, "ana", role)
    sid = await enter(access, "ana")
    clock.advance(hours * 3600 - 1)
    assert await who(access, sid) is not None
    clock.advance(1)
    assert await who(access, sid) is None


# ---- where and how many -----------------------------------------------------------------------------------


async def test_an_engineer_who_turns_up_elsewhere_has_to_sign_in_again_an_operator_not(access: Access) -> None:
    await add(access, "ana", "engineer")
    await add(access, "marko", "operator")
    ana, marko = await enter(access, "ana"), await enter(access, "marko")
    moved = await who(access, ana, address="10.9.9.9")
    assert moved and moved.idle
    assert not (await who(access, marko, address="10.9.9.9")).idle  # type: ignore[union-attr]


async def test_a_session_does_not_move_to_another_kind_of_browser(access: Access) -> None:
    await add(access, "ana")
    sid = await enter(access, "ana")
    assert await who(access, sid, agent="curl/8.0") is None
    assert await who(access, sid, agent=AGENT.replace("140", "141")) is not None


def test_a_browser_is_called_by_name_and_system() -> None:
    assert family(AGENT) == "Firefox, Linux"
    assert family("Mozilla/5.0 (Windows NT 10.0) AppleWebKit Chrome/120 Safari/537 Edg/120") == "Edge, Windows"
    assert family("evil\r\nname/1") == "evil\\x0d\\x0aname"


@pytest.mark.parametrize(
    ("roles", "limit"), [(["operator"], 3), (["engineer"], 2), (["admin"], 1), (["admin", "engineer", "operator"], 3)]
)
async def test_one_session_too_many_ends_the_oldest(
    access: Access, clock: ManualClock, roles: list[str], limit: int
) -> None:
    await add(access, "ana", *roles)
    sids = []
    for _ in range(limit + 1):
        clock.advance(1)
        sids.append(await enter(access, "ana"))
    alive = [await who(access, sid) is not None for sid in sids]
    assert alive == [False] + [True] * limit


async def test_an_ended_session_is_dead_at_once_and_the_sockets_hear_of_it(access: Access) -> None:
    await add(access, "ana")
    sid = await enter(access, "ana")
    heard: list[str] = []
    access.sessions.subscribe(heard.extend)
    assert await access.sessions.end(boss(), hash_of(sid))
    assert heard == [hash_of(sid)]
    assert await who(access, sid) is None
    assert not await access.sessions.end(boss(), hash_of(sid))


async def test_a_changed_password_ends_all_sessions_but_the_one_it_was_changed_in(access: Access) -> None:
    await add(access, "ana")
    here, there = await enter(access, "ana"), await enter(access, "ana")
    person = await who(access, here)
    assert person is not None
    fresh = await access.own.change_password(person, PASSWORD, "sedam zelenih biciklista", AGENT, here)
    assert [await who(access, sid) is not None for sid in (here, there, fresh)] == [False, False, True]


async def test_the_own_password_cannot_be_guessed_from_an_open_session(access: Access) -> None:
    await add(access, "ana")
    sid = await enter(access, "ana")
    person = await who(access, sid)
    assert person is not None
    said = []
    for _ in range(7):
        with pytest.raises(Refused) as caught:
            await access.own.change_password(person, "wrong", "sedam zelenih biciklista", AGENT, sid)
        said.append(caught.value.status)
    assert said == [401] * 5 + [429] * 2


async def test_a_request_asks_the_database_once_who_it_is(access: Access) -> None:
    await add(access, "ana", "operator", "engineer")
    await add(access, "eva")
    sids = [await enter(access, name) for name in ("ana", "eva")]
    asked: list[str] = []
    event.listen(access.sessions._db.engine, "before_cursor_execute", lambda *given: asked.append(given[2]))
    found = [await who(access, sid) for sid in sids]
    assert [person and person.roles for person in found] == [{"operator", "engineer"}, {"operator"}]
    assert len(asked) == 2
    asked.clear()
    await access.sessions.renew()
    assert len(asked) == 1, "all that are in use together"


async def test_without_the_database_a_known_person_may_still_watch_and_stop(access: Access) -> None:
    await add(access, "ana", "engineer")
    sid = await enter(access, "ana")
    await who(access, sid)

    async def broken(work: object) -> object:
        raise StorageError("pogon.db: disk I/O error")

    access.sessions._db.read = broken  # type: ignore[method-assign, assignment]
    person = await who(access, sid)
    assert person and person.permissions == {"view", "account", "stop"}
    with pytest.raises(StorageError):
        await who(access, "a" * 43)


def installation(folder: Path, empty_database: Path) -> Path:
    """Another data folder."""
    prepare(folder)
    shutil.copyfile(empty_database, folder / "pogon.db")
    return folder
