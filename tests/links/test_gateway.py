"""Parameters through a PLC between: the same client, the same answers, and every fault of the fieldbus told for what it is."""

import asyncio

import pytest

from app.errors import BadAnswer, LinkError, MailboxRefused, NoAnswer
from app.links.mailbox import Missed
from app.profidrive.parameter_access.error_numbers import MailboxError
from app.profidrive.parameter_access.messages import Address, Failed, Values, Written
from app.sim.sinamics.mailbox import MailboxFault
from tests.links.mailbox_drive import U16, MailboxDrive
from tests.links.plc_devices import KINDS
from tests.links.test_mailbox import CHANGES, FIVE, GOT_FIVE, mailbox, missed


def between() -> MailboxDrive:
    return MailboxDrive(gateway=True)


@pytest.mark.parametrize("kind", KINDS)
async def test_reads_and_changes_of_several_users_are_answered_one_by_one(kind: str) -> None:
    device = between()
    async with mailbox(device, kind) as (box, line, _):
        reads = [box.read(2, [Address(n, i) for n in range(1, 90)]) for i in range(3)]
        results = await asyncio.gather(
            *reads, box.change(2, CHANGES), box.read(2, [Address(945, count=64), Address(1000)])
        )
        for i in range(3):
            found = results[i]
            assert found[3:] == [Values(U16, (n + i,)) for n in range(4, 90)]
        assert results[3] == [Written(), Failed(1, (0,)), Written()]
        assert results[4] == [Values(U16, tuple(945 + n for n in range(64))), Failed(0)]
        assert device.values == {(1, 0): 50, (2, 0): 60} and line.value("d.a") == 7


@pytest.mark.parametrize(
    ("fault", "error", "number", "sent", "done"),
    [
        (MailboxFault.UNREACHED, MailboxRefused, MailboxError.UNREACHED, False, False),
        (MailboxFault.UNANSWERED, MailboxRefused, MailboxError.UNANSWERED, True, True),
        (MailboxFault.INTERNAL, MailboxRefused, MailboxError.UNANSWERED, True, True),
        (MailboxFault.BUSY, MailboxRefused, MailboxError.INVALID_STATE, False, False),
        (MailboxFault.RESTART, BadAnswer, 0, True, False),
        (MailboxFault.FOREIGN, BadAnswer, 0, True, True),
        (MailboxFault.WRONG_LENGTH, BadAnswer, 0, True, True),
        (MailboxFault.LATE, NoAnswer, 0, True, False),
        (MailboxFault.NEVER, NoAnswer, 0, True, False),
    ],
)
async def test_each_fault_is_told_for_what_it_is_and_passes(
    fault: int, error: type[LinkError], number: int, sent: bool, done: bool
) -> None:
    device = between()
    async with mailbox(device) as (box, _, _):
        device.fault = fault
        told = await box.change(2, CHANGES)
        assert missed(told, error, sent=sent), told
        first = told[0]
        assert isinstance(first, Missed) and getattr(first.error, "number", 0) == number
        await asyncio.sleep(0.1)
        assert bool(device.values) is done
        assert isinstance((await box.read(2, [Address(1)]))[0], Missed)
        device.fault = 0
        if fault in (MailboxFault.LATE, MailboxFault.NEVER):
            await asyncio.sleep(3)
        assert await box.read(2, FIVE[2:]) == GOT_FIVE[2:]


async def test_a_read_outlives_a_restart_of_the_plc() -> None:
    """Its request is gone from the mailbox: that is seen long before its time is over, and it is asked again."""
    device = between()
    async with mailbox(device) as (box, _, _):
        device.fault = MailboxFault.RESTART
        loop = asyncio.get_running_loop()
        began = loop.time()
        loop.call_later(0.3, setattr, device, "fault", 0)
        assert await box.read(2, FIVE) == GOT_FIVE
        assert loop.time() - began < 1.0 + 0.5  # the limit of one answer, of which it did not wait for the rest


async def test_a_request_that_is_given_up_leaves_no_answer_to_the_next_one() -> None:
    device = between()
    async with mailbox(device) as (box, _, _):
        for n in range(1, 30):
            job = asyncio.create_task(box.read(2, [Address(n)]))
            await asyncio.sleep(0.005 * n)
            job.cancel()
            await asyncio.gather(job, return_exceptions=True)
            assert await box.read(2, [Address(n + 100)]) == [Values(U16, (n + 100,))]
