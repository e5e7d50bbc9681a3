"""The table of accounts: names, ids, and no word that becomes SQL."""

from pathlib import Path

import pytest

from app.access.access import Access
from app.access.audit.search import Filter
from app.errors import Refused
from tests.access.conftest import PASSWORD, add, boss, enter, who
from tests.access.refusals import reason


async def test_an_id_is_never_given_again(access: Access) -> None:
    await add(access, "ana", "admin")
    first = await add(access, "marko")
    await access.people.delete(boss(), first)
    assert await add(access, "marko") > first


@pytest.mark.parametrize(
    "name", ["", "a", "guest", "SYSTEM", "a b", "x" * 33, "<script>", "ana\n", "' OR 1=1--", "token:x"]
)
async def test_unusable_names_are_refused(access: Access, name: str) -> None:
    with pytest.raises(Refused) as caught:
        await access.people.add(boss(), name if name != "ana\n" else "an\na", "", ["operator"])
    assert reason(caught) == ("access.name_unusable", 422)


async def test_two_spellings_of_a_name_are_one_account(access: Access) -> None:
    await add(access, "željko")
    with pytest.raises(Refused, match="name_taken"):
        await access.people.add(boss(), "z\u030celjko".upper(), "", ["operator"])


@pytest.mark.parametrize("text", ["' OR 1=1--", "x'; DROP TABLE person;--", '"; SELECT 1', "%", "_", "ana\x00"])
async def test_names_never_become_sql(access: Access, text: str) -> None:
    await add(access, "ana")
    with pytest.raises(Refused, match=r"access\.failed"):
        await enter(access, text, text)
    assert await access.audit.find(Filter(person=text, object=text, kind=text)) == []
    assert len(await access.people.all()) == 1


async def test_no_secret_lies_in_the_database_in_plain(access: Access, data: Path) -> None:
    await access.start()
    await add(access, "ana", "admin")
    _, initial = await access.people.add(boss(), "marko", "", ["operator"])
    sid = await enter(access, "ana")
    person = await who(access, sid)
    assert person is not None
    _, token = await access.tokens.create(person, "mes", ["view"], 7)
    kept = everything(data)
    for secret in (PASSWORD, initial, sid, token):
        assert secret.encode() not in kept
    assert kept.count(b"$argon2id$") >= 2


def everything(data: Path) -> bytes:
    """All that lies in the data folder, but the code, which is meant to be read."""
    return b"".join(path.read_bytes() for path in data.iterdir() if path.name != "first-code")
