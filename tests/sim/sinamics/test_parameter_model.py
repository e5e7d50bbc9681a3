"""Every parameter of the drive is read, written within its limits, and refused with the right number."""

import struct
from math import inf, nan

import pytest

from app.profidrive.parameter_access.formats import LAYOUTS, Format
from app.profidrive.parameter_access.messages import Address, Attribute, Failed, Request, Values, Written
from app.profidrive.parameter_access.parameter import DriveParameter, When
from app.profidrive.parameter_access.source import is_source
from app.profidrive.words import RUN
from app.sim.sinamics.drive import VirtualSinamics
from app.sim.sinamics.mailbox import MailboxFault, fitting
from app.sim.sinamics.training import REG_MAILBOX
from app.sim.training import REG_MACHINE_FAULT, REG_POWER, REG_RESET
from tests.sim.sinamics.mailbox_stand import (
    PARAMETERS,
    PROBLEMS,
    WINDOW,
    ask,
    error,
    home,
    powered,
    read,
    send,
    values,
    write,
)
from tests.sim.sinamics.stand import command, step

ACTS = {"p0952", "p0971", "p0977", "p3981", "p0969", "p2507", "p2506"}
"""Writing them does something, or they go on by themselves."""
PLAIN = [
    one
    for one in PARAMETERS.values()
    if one.writable and not one.trigger and one.code not in ACTS and not is_source(one.kind)
]
SOURCES = [one for one in PARAMETERS.values() if is_source(one.kind)]


def test_there_are_enough_and_every_one_is_whole() -> None:
    assert PROBLEMS == [] and len(PARAMETERS) >= 150
    for code, one in PARAMETERS.items():
        assert code == one.code and set(one.objects) <= {1, 2} and one.count <= 300
        if one.writable:
            assert one.low <= one.default <= one.high and (not one.allowed or one.default in one.allowed)


def test_every_parameter_of_every_drive_object_is_read_and_no_other() -> None:
    drive = powered()
    for object in (1, 2):
        there = {one.number: one for one in PARAMETERS.values() if object in one.objects}
        listed = values_of_list(drive, object)
        assert listed == sorted(there)
        for number in (*there, 1, 9999, 65535, *(set(range(20, 40)) - set(there))):
            one = there.get(number)
            (result,) = ask(drive, Request(1, object, (Address(number, 0, min(one.count, 50) if one else 0),)))
            if one is None:
                assert result == Failed(0x00)
            else:
                assert isinstance(result, Values) and result.format is one.format
                assert len(result.values) == min(one.elements, 50)
    assert ask(drive, Request(1, 3, (Address(945),))) == (Failed(0x19),)


def values_of_list(drive: VirtualSinamics, object: int) -> list[int]:
    found: list[int] = []
    for first in range(0, 299, 100):
        (block,) = ask(drive, Request(1, object, (Address(980, first, min(100, 299 - first)),)))
        assert isinstance(block, Values)
        found += [int(number) for number in block.values if number]
    return found


def test_a_g120_has_everything_in_its_one_drive_object() -> None:
    drive = powered(process_words=2)
    for code in ("r0945", "p0971", "p1120", "r0964"):
        assert isinstance(read(drive, code, object=1), Values)
        assert error(read(drive, code, object=2)) == 0x19
    assert values(drive, "r0102") == (1,) and values(drive, "p0101", 0, 3) == (1, 0, 0)
    assert values(powered(), "r0102") == (2,) and values(powered(), "p0101", 0, 3) == (1, 2, 0)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("one", PLAIN, ids=lambda one: one.code)
def test_a_written_parameter_takes_its_limits_and_nothing_beyond(one: DriveParameter) -> None:
    drive = powered()
    if one.when is When.COMMISSIONING:
        assert error(write(drive, one.code, one.default)) == 0x75
        assert write(drive, "p0010", 1) == Written()
    last = one.elements - 1
    for value in one.allowed or (one.low, one.high):
        assert write(drive, one.code, value, subindex=last) == Written()
        assert values(drive, one.code, last) == pytest.approx((value,), rel=1e-6)
    before = values(drive, one.code, last)
    for value in (one.low - 1, one.high + 1, one.low * 1.01 - 1, nan, inf):
        result = write_raw(drive, one, value, last)
        assert result is None or result == Failed(0x02, (last,)), value
    if one.allowed:
        assert error(write(drive, one.code, next(n for n in range(1, 999) if n not in one.allowed))) == 0x14
    wrong = Format.FLOAT32 if one.format is not Format.FLOAT32 else Format.INTEGER16
    assert error(write(drive, one.code, 0, subindex=last, format=wrong)) == 0x05
    assert error(write(drive, one.code, 0, subindex=last, attribute=Attribute.DESCRIPTION)) == 0x07
    assert error(write(drive, one.code, 0, subindex=last, attribute=Attribute.TEXT)) == 0x20
    assert error(write(drive, one.code, *(one.default,) * 2, subindex=last)) == (0x03 if one.count else 0x04)
    assert error(write(drive, one.code, one.default, subindex=one.elements)) == (0x03 if one.count else 0x04)
    assert values(drive, one.code, last) == before


@pytest.mark.parametrize("one", SOURCES, ids=lambda one: one.code)
def test_an_interconnection_names_a_parameter_that_there_is(one: DriveParameter) -> None:
    drive = powered()
    for value in (0, 1, 722 << 16 | 63 << 10 | 3):
        assert write(drive, one.code, value, subindex=one.elements - 1) == Written()
        assert values(drive, one.code, one.elements - 1) == (value,)
    for value in (2, 9999 << 16 | 63 << 10, 0xFFFFFFFF):
        assert error(write(drive, one.code, value, subindex=one.elements - 1)) == 0x83


def test_what_only_starts_something_reads_0_again() -> None:
    drive = powered()
    for one in PARAMETERS.values():
        if one.trigger and one.code not in ("p0952", "p0971", "p0977"):
            assert write(drive, one.code, 1) == Written() and values(drive, one.code) == (0,)


def write_raw(drive: VirtualSinamics, one: DriveParameter, value: float, subindex: int) -> object:
    """Write a value that our codec may not encode; None where the format cannot say it."""
    layout = LAYOUTS[one.format]
    try:
        data = struct.pack(f">{layout.code}", value if layout.code == "f" else int(value))
    except (struct.error, ValueError, OverflowError):
        return None
    head = struct.pack(">BBBBBBHHBB", 1, 2, home(one), 1, 0x10, 1, one.number, subindex, one.format, 1)
    if layout.code == "f" and one.low <= struct.unpack(">f", data)[0] <= one.high:
        return None
    message = head + data + b"\0" * (len(data) % 2)
    words = [1, 0x2F00 | len(message)]
    words += [int.from_bytes(message[i : i + 2], "big") for i in range(0, len(message), 2)]
    window = send(drive, words)
    assert window[2] == 0x0182, window[:8]
    return Failed(window[5], (window[6],))


@pytest.mark.sweep(8)
@pytest.mark.parametrize("one", [one for one in PARAMETERS.values() if not one.writable], ids=lambda one: one.code)
def test_what_is_only_read_is_not_written(one: DriveParameter) -> None:
    drive = powered()
    assert write(drive, one.code, 1) == Failed(0x01, (0,))
    assert error(read(drive, one.code, one.elements)) == (0x03 if one.count else 0x04)
    assert error(ask(drive, Request(1, home(one), (Address(one.number, 0, 1, Attribute.DESCRIPTION),)))[0]) == 0x09
    assert error(ask(drive, Request(1, home(one), (Address(one.number, 0, 1, Attribute.TEXT),)))[0]) == 0x0F


def test_a_raw_word_is_taken_for_an_unsigned_value_of_its_size() -> None:
    drive = powered()
    assert write(drive, "p0952", 0, format=Format.WORD) == Written()
    assert write(drive, "p2040", 500, format=Format.DOUBLE_WORD) == Written()
    assert values(drive, "p2040") == (500,)
    assert error(write(drive, "p2040", 500, format=Format.WORD)) == 0x05
    assert error(write(drive, "p1462", 5, format=Format.DOUBLE_WORD)) == 0x05


def test_while_it_runs_only_what_may_be_changed_is() -> None:
    drive = powered(start="forward", setpoint=50)  # type: ignore[arg-type]
    for one in PLAIN:
        result = write(drive, one.code, *values(drive, one.code))
        assert result == (Written() if one.when is When.ALWAYS else Failed(0x6B)), one.code


def test_what_is_written_acts_in_the_drive_and_is_seen_in_its_registers() -> None:
    drive = powered()
    assert write(drive, "p1120", 12.5) == Written()
    assert drive.parameter("p1120") == 12.5 and drive.read(3, 40322 - 40001, 1) == [1250]
    drive.write(6, 40323 - 40001, [700])
    step(drive, 0.01)
    assert values(drive, "p1121") == (7.0,)


def test_live_values_are_those_of_the_motor() -> None:
    drive = powered(start="forward", setpoint=50)  # type: ignore[arg-type]
    step(drive, 2)
    speed, current, bus = values(drive, "r0022")[0], values(drive, "r0027")[0], values(drive, "r0026")[0]
    assert speed == pytest.approx(drive.speed, rel=0.01) and speed > 700
    assert current == pytest.approx(drive.shaft.current, rel=0.05) and 400 < bus < 700
    assert values(drive, "r0020") == (750,) and values(drive, "r0002") == (0,)
    assert values(drive, "r0054") == (RUN,) and values(drive, "r0052") == (drive.status,)
    assert values(drive, "r0722") == (3,) and values(drive, "r0018") == (4700000,)
    assert values(drive, "r2050", 0, 2) == (RUN, 0x2000)
    assert values(drive, "r2053", 0, 2)[1] == pytest.approx(0x2000, abs=0x60)
    drive.write(6, 0xE025, [1])
    step(drive, 0.1)
    assert values(drive, "r0722") == (2,) and values(drive, "r0002") == (42,)


def test_faults_shift_by_situations_and_alarms_move_to_their_history() -> None:
    drive = powered()
    command(drive, 0x047E)
    for round, number in enumerate((7860, 7452)):
        drive.write(6, REG_MACHINE_FAULT, [number])
        step(drive, 0.1)
        drive.write(6, REG_MACHINE_FAULT, [0])
        step(drive, 0.1)
        assert values(drive, "r0945", 0, 2) == (number, 0) and values(drive, "r2131") == (number,)
        assert values(drive, "r0948")[0] > 0 and values(drive, "r2109")[0] == 0
        assert write(drive, "p3981", 1) == Written()
        step(drive, 0.1)
        assert drive.faults == [] and values(drive, "p0952") == (round + 1,)
    shown = values(drive, "r0947", 0, 64)
    assert (shown[0], shown[8], shown[16]) == (0, 7452, 7860) and sum(map(bool, shown)) == 2
    came, gone = values(drive, "r0948", 8)[0], values(drive, "r2109", 8)[0]
    assert 0 < came < gone and values(drive, "r0944") == (4,)
    assert write(drive, "p0952", 5) == Failed(0x06, (0,))
    assert write(drive, "p0952", 0) == Written()
    assert not any(values(drive, "r0945", 0, 64)) and values(drive, "p0952") == (0,)
    drive.write(6, REG_MACHINE_FAULT, [7850])
    step(drive, 0.1)
    assert values(drive, "r2122", 0, 2) == (7850, 0) and values(drive, "r2132") == (7850,)
    drive.write(6, REG_MACHINE_FAULT, [0])
    step(drive, 0.1)
    assert values(drive, "r2122", 0, 9) == (0,) * 8 + (7850,)
    assert values(drive, "r2125", 8)[0] > values(drive, "r2123", 8)[0] > 0


@pytest.mark.parametrize("save", ["p0971", "p0977"])
def test_what_was_saved_survives_power_off_and_what_was_not_does_not(save: str) -> None:
    drive = powered()
    drive.buffer.enter(7860)
    for code in ("p1120", "p1047"):
        assert write(drive, code, 33) == Written()
    assert write(drive, save, 1) == Written()
    assert values(drive, save) == (1,)
    step(drive, 1)
    assert values(drive, save) == (0,)
    for code in ("p1120", "p1047"):
        assert write(drive, code, 44) == Written()
    off_and_on(drive)
    assert values(drive, "p1120") == values(drive, "p1047") == (33,)
    assert values(drive, "r0945") == (7860,) and drive.speed == 0
    write(drive, "p1120", 55)
    write(drive, save, 1)
    off_and_on(drive)  # before it was saved
    assert values(drive, "p1120") == (33,) and values(drive, save) == (0,)
    drive.write(6, REG_RESET, [1])
    step(drive, 0.1)
    assert values(drive, "p1120") == (5,) and values(drive, "p1047") == (10,)


def off_and_on(drive: VirtualSinamics) -> None:
    drive.write(6, REG_POWER, [1])
    step(drive, 0.1)


def test_an_answer_that_gets_too_long_says_so_for_what_has_no_room() -> None:
    drive = powered()
    long = ask(drive, Request(1, 2, (Address(948, 0, 64), Address(945, 0, 64), Address(1120))))
    assert long[0] == Failed(0x15) and isinstance(long[1], Values) and isinstance(long[2], Values)
    assert fitting([Values(Format.UNSIGNED8, (1,) * 234)] * 2)[1] == Failed(0x15)


@pytest.mark.parametrize(
    ("fault", "head"),
    [
        (MailboxFault.LATE, [1, 0x2F00, 4]),
        (MailboxFault.NEVER, [1, 0x2F00, 4]),
        (MailboxFault.BUSY, [2, 0x2F00, 2]),
        (MailboxFault.INTERNAL, [2, 0x2F00, 5]),
        (MailboxFault.FOREIGN, [2, 0x2F0A, 0x0201]),
        (MailboxFault.WRONG_LENGTH, [2, 0x2F0C, 0x0101]),
    ],
)
def test_the_instructor_spoils_the_mailbox(fault: int, head: list[int]) -> None:
    drive = powered()
    drive.write(6, REG_MAILBOX, [fault])
    step(drive, 0.01)
    drive.write(16, WINDOW, [1, 0x2F0A, 0x0101, 0x0101, 0x1001, 0x0012, 0])
    step(drive, 0.1)
    assert drive.read(3, WINDOW, 3) == head
    step(drive, 2)
    done = fault != MailboxFault.NEVER
    assert drive.read(3, WINDOW, 1) == [2 if done else 1]
    drive.write(6, REG_MAILBOX, [0])
    step(drive, 0.1)
    assert values(drive, "r0018") == (4700000,)


def test_what_lies_in_the_window_is_judged_as_the_reference_says() -> None:
    drive = powered()
    read_r18 = [1, 0x2F0A, 0x0101, 0x0101, 0x1001, 0x0012, 0]
    assert send(drive, read_r18)[:7] == [2, 0x2F0A, 0x0101, 0x0101, 0x0701, 0x0047, 0xB760]
    assert send(drive, [1, 0x300A, *read_r18[2:]])[:3] == [2, 0x2F00, 3]
    assert send(drive, [1, 0x2F09, *read_r18[2:]])[:3] == [2, 0x2F00, 1]
    assert send(drive, [1, 0x2F02, 0x0101])[:3] == [2, 0x2F00, 1]
    assert send(drive, [1, 0x2FF2, *read_r18[2:]])[:3] == [2, 0x2F00, 1]
    assert send(drive, [1, 0x2F0C, *read_r18[2:], 0])[:3] == [2, 0x2F00, 1]
    assert send(drive, [1, 0x2F0A, 0x0105, *read_r18[3:]])[:6] == [2, 0x2F08, 0x0185, 0x0101, 0x4401, 0x21]
    assert send(drive, [1, 0x2F0A, 0x0101, 0x0101, 0x1101, 0x0012, 0])[4:6] == [0x4401, 0x16]
    illegal = [1, 0x2F0E, 0x0102, 0x0201, 0x1001, 0x0460, 0, 0x7F01, 0]
    assert send(drive, illegal)[4:6] == [0x4401, 0x17]
    count = [1, 0x2F0E, 0x0102, 0x0201, 0x1001, 0x0460, 0, 0x0601, 0]
    assert send(drive, count)[4:6] == [0x4401, 0x05]
    drive.write(16, 40601 - 40001, read_r18)
    assert drive.read(3, 40601 - 40001, 3) == [1, 0x2F00, 4]
    drive.write(16, 40601 - 40001, [0, 0x2F0A])  # taken back
    step(drive, 1)
    assert drive.read(3, 40601 - 40001, 2) == [0, 0x2F0A]
