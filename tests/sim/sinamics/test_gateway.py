"""The simulated PLC between a mailbox and its drive does what docs/gateway.md says, register by register."""

import re
from pathlib import Path

import pytest

from app.profidrive.parameter_access.mailbox import LOOK, Control, look
from app.profidrive.parameter_access.messages import Address, Request
from app.sim.sinamics import training as own
from app.sim.sinamics.drive import VirtualSinamics
from app.sim.sinamics.mailbox import MailboxFault
from tests.sim.sinamics.mailbox_stand import WINDOW, ask, powered, read, send
from tests.sim.sinamics.stand import step

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "gateway.md").read_text("utf-8")
REQUEST = [1, 0x2F0A, 0x0901, 0x0201, 0x1001, 0x0460, 0]
"""Reads p1120 of drive object 2."""
TOLD = {
    1: ([1, 0x2F03, 0], MailboxFault.NONE),
    2: (REQUEST, MailboxFault.BUSY),
    3: ([1, 0x2E0A, *REQUEST[2:]], MailboxFault.NONE),
    6: (REQUEST, MailboxFault.UNREACHED),
    7: (REQUEST, MailboxFault.UNANSWERED),
}


def between() -> VirtualSinamics:
    drive = powered(gateway=True)
    step(drive, drive.dt)  # its first scan empties the mailbox
    return drive


def test_the_page_has_every_error_and_the_window_is_where_it_says() -> None:
    rows = dict(re.findall(r"^\| (\d) \| (.*?) \|", PAGE, re.MULTILINE))
    assert {int(number) for number in rows} == {*TOLD, 4, 5}
    assert f"begins at {WINDOW}" in PAGE and f"0x{WINDOW:04X}" in PAGE
    assert re.search(rf"^\| {WINDOW} \| read, write", PAGE, re.MULTILINE)


@pytest.mark.parametrize("number", TOLD)
def test_each_error_stands_where_the_page_says(number: int) -> None:
    words, fault = TOLD[number]
    drive = between()
    drive.write(6, own.REG_MAILBOX, [fault])
    step(drive, drive.dt)
    assert send(drive, words)[:LOOK] == [2, 0x2F00, number]


def test_a_request_is_seen_to_be_taken_and_then_answered() -> None:
    drive = between()
    drive.write(16, WINDOW, REQUEST)
    step(drive, 2 * drive.dt)
    assert drive.read(3, WINDOW, 3) == [1, 0x2F00, 4]
    seconds = 2 * drive.dt
    while not look(window := drive.read(3, WINDOW, 122)).done:
        step(drive, drive.dt)
        seconds += drive.dt
    assert window[1] >> 8 == 0x2F and window[2] >> 8 == 9 and 0.05 < seconds < 0.3


def test_a_drive_behind_it_says_what_a_drive_without_it_says() -> None:
    through, direct = between(), powered()
    for request in (
        Request(3, 2, (Address(1120), Address(945, 0, 8), Address(9999), Address(1120, 5))),
        Request(4, 7, (Address(1120),)),
        Request(5, 1, (Address(978, 0, 4), Address(101, 0, 4))),
    ):
        assert ask(through, request) == ask(direct, request)
    assert read(through, "p1120") == read(direct, "p1120")


def test_a_plc_that_restarts_in_the_middle_forgets_the_request_and_takes_the_next_one() -> None:
    drive = between()
    drive.write(6, own.REG_MAILBOX, [MailboxFault.RESTART])
    step(drive, drive.dt)
    drive.write(16, WINDOW, REQUEST)
    step(drive, 10 * drive.dt)
    assert drive.read(3, WINDOW, 1) == [Control.IDLE]
    drive.write(6, own.REG_MAILBOX, [0])
    step(drive, drive.dt)
    assert look(send(drive, REQUEST)[:LOOK]).reference == 9
