"""Tokens of programs: shown once, narrow, and never more than their maker may."""

import pytest

from app.access.access import Access
from app.access.roles import Person
from app.clock import ManualClock
from app.errors import Refused
from tests.access.conftest import OpenAccess, add, boss, enter, who


async def maker(access: Access, *roles: str) -> Person:
    await add(access, "ana", *(roles or ("engineer",)))
    person = await who(access, await enter(access, "ana"))
    assert person is not None
    return person


async def test_a_token_lets_a_program_do_what_it_names_and_nothing_else(access: Access) -> None:
    token, secret = await access.tokens.create(await maker(access), "MES", ["view", "export"], 30)
    found = await access.tokens.find(secret)
    assert found and found.permissions == {"view", "export"}
    assert found.session == f"token-{token.id}"
    assert not found.may("operate")


@pytest.mark.sweep(8)
@pytest.mark.parametrize("secret", ["", "pogon_", "pogon_" + "a" * 43, "bearer", "' OR 1=1--"])
async def test_an_unknown_token_is_nobody(access: Access, secret: str) -> None:
    await access.tokens.create(await maker(access), "MES", ["view"], 30)
    assert await access.tokens.find(secret) is None


async def test_a_token_ends_by_time_by_revoking_and_with_its_maker(access: Access, clock: ManualClock) -> None:
    ana = await maker(access)
    secrets = []
    for name in ("a", "b", "c"):
        token, secret = await access.tokens.create(ana, name, ["view"], 1 if name == "a" else 30)
        secrets.append(secret)
        if name == "b":
            await access.tokens.revoke(ana, token.id)
    assert [await access.tokens.find(s) is not None for s in secrets] == [True, False, True]
    clock.advance(86_401)
    assert [await access.tokens.find(s) is not None for s in secrets] == [False, False, True]
    await add(access, "chief", "admin")
    await access.people.disable(boss(), ana.id, True)
    assert await access.tokens.find(secrets[2]) is None


async def test_a_token_shrinks_with_the_roles_of_its_maker(access: Access) -> None:
    ana = await maker(access)
    _, secret = await access.tokens.create(ana, "MES", ["view", "configure"], 30)
    await add(access, "chief", "admin")
    await access.people.set_roles(boss(), ana.id, ["viewer"])
    found = await access.tokens.find(secret)
    assert found and found.permissions == {"view"}


async def test_that_it_shrank_is_told_once_whoever_asks_first(open_access: OpenAccess) -> None:
    server, terminal = open_access(), open_access()
    ana = await maker(server)
    token, secret = await server.tokens.create(ana, "MES", ["view", "configure"], 30)
    assert await server.tokens.find(secret)
    told: list[str] = []
    server.tokens.subscribe(told.extend)
    terminal.people.set_roles_now(boss(), "ana", ["viewer"])
    found = await server.tokens.find(secret)
    assert found and found.permissions == {"view"}
    await server.tokens.renew()
    assert told == [f"token-{token.id}"]


@pytest.mark.parametrize(
    ("permissions", "days", "reason"),
    [
        ([], 7, "token_permissions"),
        (["administer"], 7, "token_permissions"),
        (["fly"], 7, "token_permissions"),
        (["view"], 0, "token_days"),
        (["view"], 4000, "token_days"),
    ],
)
async def test_what_cannot_be_given_is_refused(
    access: Access, permissions: list[str], days: float, reason: str
) -> None:
    with pytest.raises(Refused, match=reason):
        await access.tokens.create(await maker(access), "MES", permissions, days)


async def test_nobody_gives_what_they_do_not_have(access: Access) -> None:
    with pytest.raises(Refused, match="denied"):
        await access.tokens.create(await maker(access, "admin"), "MES", ["operate"], 7)
