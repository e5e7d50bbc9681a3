"""One's own account: what wrong passwords lock, and for whom."""

import pytest

from app.access.access import Access
from app.errors import Refused
from tests.access.conftest import PASSWORD, add, enter, who


async def test_a_stranger_at_the_sign_in_does_not_hold_up_who_is_in(access: Access) -> None:
    await add(access, "eve", "engineer")
    eve = await who(access, await enter(access, "eve"))
    assert eve is not None
    told: list[tuple[str, str]] = []
    access.tell = lambda alarm, name: told.append((alarm, name))
    for _ in range(7):
        with pytest.raises(Refused):
            await enter(access, "eve", "wrong wrong wrong")
    assert told == [("account_locked", "eve")]
    await access.own.confirm(eve, PASSWORD)


async def test_wrong_own_passwords_lock_the_session_and_not_the_account(access: Access) -> None:
    await add(access, "eve", "engineer")
    eve = await who(access, await enter(access, "eve"))
    assert eve is not None
    for _ in range(5):
        with pytest.raises(Refused):
            await access.own.confirm(eve, "wrong wrong wrong")
    with pytest.raises(Refused) as refused:
        await access.own.confirm(eve, PASSWORD)
    assert refused.value.status == 429
    other = await who(access, await enter(access, "eve"))
    assert other is not None
    await access.own.confirm(other, PASSWORD)
