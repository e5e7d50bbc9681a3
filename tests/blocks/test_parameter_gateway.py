"""The block of a PLC that passes parameter requests on: one at a time, never an answer to another one, every ending told."""

import random

import pytest

from app.blocks.parameter_gateway import TRIES, Bus, ParameterGateway, Records
from app.profidrive.parameter_access.mailbox import WORDS, look

IDLE, WRITE, READ = Records(), Records(write=True), Records(read=True)
REQUEST = (1, 0x2F0A, 0x0901, 0x0201, 0x1001, 0x0460, 0)
ANSWER = (0x0901, 0x0201, 0x0301, 0x0007)


def asked(words: tuple[int, ...] = REQUEST) -> ParameterGateway:
    gateway = ParameterGateway()
    assert gateway.scan(Bus()) == IDLE and gateway.window[:2] == [0, 0x2F00]
    gateway.window[: len(words)] = words
    return gateway


def test_a_request_goes_out_as_it_lies_and_its_answer_comes_back_as_it_is() -> None:
    gateway = asked()
    assert gateway.scan(Bus()) == WRITE and gateway.record == REQUEST[2:] and gateway.length == 10
    assert gateway.window[:3] == [1, 0x2F00, 4]
    assert gateway.scan(Bus()) == WRITE
    assert gateway.scan(Bus(write_done=True)) == READ
    assert gateway.scan(Bus(read_error=True, not_ready=True)) == IDLE
    assert gateway.scan(Bus()) == READ
    assert gateway.scan(Bus(read_done=True, answer=ANSWER, length=8)) == IDLE
    assert gateway.window[:6] == [2, 0x2F08, *ANSWER]
    assert gateway.scan(Bus()) == IDLE


@pytest.mark.parametrize(
    ("head", "error"), [(0x2E0A, 3), (0x000A, 3), (0x2F02, 1), (0x2F0B, 1), (0x2FF2, 1), (0x2FFF, 1)]
)
def test_what_is_no_request_is_refused(head: int, error: int) -> None:
    gateway = asked((1, head, *REQUEST[2:]))
    assert gateway.scan(Bus()) == IDLE and gateway.window[:3] == [2, 0x2F00, error]


@pytest.mark.parametrize("length", [4, 240])
def test_the_shortest_and_the_longest_request_are_taken(length: int) -> None:
    gateway = asked((1, 0x2F00 | length, *range(1, 121)))
    assert gateway.scan(Bus()) == WRITE and gateway.record == tuple(range(1, length // 2 + 1))


@pytest.mark.parametrize(
    ("scans", "error"),
    [
        ([Bus(write_error=True, write_refused=True)], 2),
        ([Bus(write_error=True)], 6),
        ([Bus(write_done=True), Bus(read_error=True)], 7),
        ([Bus(write_done=True), *[Bus(read_error=True, not_ready=True), Bus()] * TRIES, Bus(read_error=True, not_ready=True)], 7),
    ],
)  # fmt: skip
def test_every_failure_is_told_and_the_next_request_is_taken(scans: list[Bus], error: int) -> None:
    gateway = asked()
    gateway.scan(Bus())
    for bus in scans[:-1]:
        gateway.scan(bus)
        assert not look(gateway.window).done
    assert gateway.scan(scans[-1]) == IDLE and gateway.window[:3] == [2, 0x2F00, error]
    gateway.window[: len(REQUEST)] = REQUEST
    assert gateway.scan(Bus()) == WRITE


@pytest.mark.parametrize(
    "scans", [[], [Bus(write_done=True)], [Bus(write_done=True), Bus(read_error=True, not_ready=True)]]
)
@pytest.mark.parametrize("ends", ["write", "read", "errors"])
def test_a_request_that_is_written_over_is_never_answered(scans: list[Bus], ends: str) -> None:
    gateway = asked()
    now = gateway.scan(Bus())
    for bus in scans:
        now = gateway.scan(bus)
    gateway.window[: len(REQUEST)] = newer = (1, 0x2F0A, 0x0A01, *REQUEST[3:])
    for _ in range(5):
        if gateway.record == newer[2:]:
            break
        assert not look([gateway.window[0], 0x2F00, 4]).done
        if ends == "errors":
            bus = Bus(write_error=now.write, read_error=now.read)
        else:
            bus = Bus(write_done=now.write, read_done=now.read, answer=ANSWER, length=8)
        now = gateway.scan(bus)
    assert now == WRITE and gateway.record == newer[2:] and gateway.window[:3] == [1, 0x2F00, 4]


def test_after_a_restart_the_mailbox_is_empty() -> None:
    before = asked()
    before.scan(Bus())
    after = ParameterGateway()
    after.window[:] = before.window
    assert after.scan(Bus()) == IDLE and after.window[0] == 0 and look(after.window).idle


@pytest.mark.sweep(8)
def test_whatever_is_written_and_heard_it_goes_on() -> None:
    chance = random.Random(7)
    gateway = ParameterGateway()
    for _ in range(20_000):
        if chance.random() < 0.1:
            at = chance.choice((0, 0, 1, chance.randrange(WORDS)))
            for n in range(at, min(WORDS, at + chance.randrange(1, 9))):
                gateway.window[n] = chance.choice((0, 1, 2, 0x2F00, 0x2F0A, chance.randrange(0x10000)))
        flags = [chance.random() < 0.3 for _ in range(6)]
        answer = tuple(chance.randrange(0x10000) for _ in range(chance.randrange(130)))
        now = gateway.scan(Bus(*flags, answer, chance.randrange(300)))
        assert len(gateway.window) == WORDS and all(0 <= word <= 0xFFFF for word in gateway.window)
        assert not (now.write and now.read)
    gateway.window[: len(REQUEST)] = REQUEST
    for _ in range(4):
        now = gateway.scan(Bus(write_error=True, read_error=True))
    gateway.window[: len(REQUEST)] = REQUEST
    assert gateway.scan(Bus()) == WRITE
