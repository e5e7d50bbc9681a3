"""The registers of a drive's mailbox: a lost or late telegram changes no answer, a refusal comes with its reason."""

import asyncio

import pytest

from app.errors import (
    BadAnswer,
    DeviceException,
)
from app.links.mailbox import Missed
from app.profidrive.parameter_access.messages import Address, Failed, Values, Written
from tests.links.mailbox_drive import U16, MailboxDrive
from tests.links.plc_devices import KINDS, once
from tests.links.test_mailbox import CHANGES, FIVE, GOT_FIVE, is_look, is_request, mailbox, missed


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("what", ["request", "answer", "late", "gateway"])
@pytest.mark.parametrize("which", [is_request, is_look])
async def test_a_lost_or_late_telegram_changes_no_answer(kind: str, what: str, which: object) -> None:
    device = MailboxDrive()
    async with mailbox(device, kind) as (box, _, bus):
        bus.fault = once(what, which)  # type: ignore[arg-type]
        assert await box.read(2, FIVE) == GOT_FIVE
        assert bus.spoiled == 1
        bus.fault = once(what, which)  # type: ignore[arg-type]
        told = await box.change(2, CHANGES)
        if what == "request" and which is is_request:
            assert missed(told, BadAnswer, sent=True) and not device.values  # it might still arrive
        else:
            assert told == [Written(), Failed(1, (0,)), Written()]
        assert sum(request.values is not None for request in device.requests) <= 1  # never sent twice
        await asyncio.sleep(0.5)
        assert await box.read(2, [Address(7)]) == [Values(U16, (7,))]


async def test_a_refusal_by_modbus_is_told_with_the_reason_that_the_drive_keeps() -> None:
    device = MailboxDrive()
    async with mailbox(device) as (box, _, _):
        device.refuses = 4
        (told,) = await box.read(2, [Address(1)])
        assert isinstance(told, Missed) and isinstance(told.error, DeviceException) and not told.sent
        assert "last access error 17" in str(told.error)
        device.refuses = 6  # busy: asked again
        assert await box.change(2, CHANGES[:1]) == [Written()]
