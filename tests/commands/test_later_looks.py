"""A value that no scan brings is read again after a command that was not confirmed: devices act late, and people do not wait."""

import pytest

from app.commands.later_looks import WHEN
from app.errors import LinkError, NoAnswer, Refused
from tests.commands.stand import EVA, Stand, settle

KEY = "f905"  # it is read once


def read(stand: Stand) -> int:
    """How often it was read."""
    return sum(KEY in points for _, points in stand.link.refreshed)


async def test_a_setpoint_overtaken_by_a_command_shows_what_the_device_made_of_it() -> None:
    stand = Stand()
    stand.drives["m1"].deaf = True
    await stand.set(EVA, KEY, 2.5, confirmed=True)
    await settle()
    stand.drives["m1"].deaf = False
    await stand.ask(EVA, "forward")
    assert stand.state() != "confirmed" and stand.tags.sample(f"m1.{KEY}").value == 1.0
    stand.set_drive(**{KEY: 2.5})  # it has taken its time
    await stand.pass_time(1)
    assert stand.tags.sample(f"m1.{KEY}").value == 2.5


@pytest.mark.sweep(8)
async def test_it_is_read_some_times_more_and_no_more_than_that() -> None:
    stand = Stand()
    stand.drives["m1"].deaf = True
    await stand.set(EVA, KEY, 2.5, confirmed=True)
    await stand.pass_time(20, lambda: stand.state() == "unconfirmed")
    await settle()
    before = read(stand)
    await stand.pass_time(WHEN[-2] + 1)
    assert read(stand) - before == len(WHEN) - 1
    stand.set_drive(**{KEY: 2.5})
    await stand.pass_time(WHEN[-1])
    assert read(stand) - before == len(WHEN) and stand.tags.sample(f"m1.{KEY}").value == 2.5
    await stand.pass_time(3 * WHEN[-1])
    assert read(stand) - before == len(WHEN)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("error", [None, NoAnswer("silence")])
async def test_what_was_confirmed_or_refused_is_not_read_again(error: LinkError | None) -> None:
    stand = Stand()
    await stand.set(EVA, KEY, 2.5, confirmed=True)
    await stand.pass_time(1)
    assert stand.state() == "confirmed"
    with pytest.raises(Refused):
        await stand.set(EVA, KEY, 1e6, confirmed=True)
    before = read(stand)
    stand.link.refresh_error = error
    await stand.pass_time(2 * WHEN[-1])
    assert read(stand) == before


async def test_a_machine_that_went_with_a_reload_is_not_read() -> None:
    stand = Stand()
    stand.drives["m1"].deaf = True
    await stand.set(EVA, KEY, 2.5, confirmed=True)
    await settle()
    await stand.ask(EVA, "forward")
    before = read(stand)
    stand.gate.take({}, "UTC")
    await stand.pass_time(WHEN[-1])
    assert read(stand) == before
