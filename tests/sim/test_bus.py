"""What a simulated line answers, with and without the instructor's hand on the cable."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import BadAnswer
from app.registers.pdu import Request, build_request, parse_answer, read_request, write_request
from app.sim.bus import Bus, LineFaultMode
from app.sim.plant import exchange
from app.sim.training import BASE, LineFault
from tests.sim.fake_device import FakeDevice

POLL = Request(3, 0x1000, 25)
POLL_PDU = build_request(POLL)


def line(fault: LineFault | None = None) -> tuple[Bus, FakeDevice]:
    device = FakeDevice(line_fault=fault or LineFault())
    return Bus({1: device, 7: FakeDevice()}, turnaround=0.005), device


def test_a_poll_gets_its_registers_after_the_turnaround() -> None:
    bus, device = line()
    answer = bus.answer(1, POLL_PDU)
    assert answer.pdu is not None
    assert parse_answer(POLL, answer.pdu) == list(range(100, 125))
    assert (answer.unit, answer.delay, answer.corrupt, device.telegrams) == (1, 0.005, "", 1)


def test_a_write_is_echoed_at_once_and_acts_at_the_next_step() -> None:
    bus, device = line()
    pdu = write_request(0x10D, [5000])
    assert bus.answer(1, pdu).pdu == pdu
    assert device.words[0x10D] == 0
    device.step()
    assert device.words[0x10D] == 5000


def test_several_words_and_read_write_go_through() -> None:
    bus, device = line()
    assert bus.answer(1, write_request(0x110, [1, 2, 3])).pdu == bytes.fromhex("10 01 10 00 03")
    device.step()
    both = Request(23, 0x110, 3, 0x120, (9,))
    answer = bus.answer(1, build_request(both)).pdu
    assert answer is not None and parse_answer(both, answer) == [1, 2, 3]
    device.step()
    assert device.words[0x120] == 9


def test_read_write_with_a_bad_read_writes_nothing() -> None:
    bus, device = line()
    assert bus.answer(1, build_request(Request(23, 0x9000, 1, 0x120, (9,)))).pdu == b"\x97\x02"
    assert not device.pending


@pytest.mark.parametrize(
    ("pdu", "answer"),
    [
        (read_request(0x1000, 1, 4), "84 01"),
        (read_request(0x3000, 1), "83 02"),
        (write_request(0x10D, [65001]), "86 03"),
        (write_request(0x1FF, [1]), "86 04"),
        (bytes.fromhex("03 10 00 00 7E"), "83 03"),
        (bytes.fromhex("03 10"), "83 03"),
        (bytes.fromhex("11"), "91 01"),
        (bytes.fromhex("83 02"), "83 01"),
    ],
)
def test_each_refusal_is_a_modbus_exception(pdu: bytes, answer: str) -> None:
    bus, device = line()
    assert bus.answer(1, pdu).pdu == bytes.fromhex(answer)
    assert device.telegrams == 1, "a refused telegram still feeds the watchdog"


def test_a_device_that_fails_answers_server_failure(caplog: pytest.LogCaptureFixture) -> None:
    class Broken(FakeDevice):
        def read(self, function: int, address: int, count: int) -> list[int]:
            raise ZeroDivisionError

    assert Bus({1: Broken()}).answer(1, POLL_PDU).pdu == b"\x83\x04"
    assert "virtual device failed" in caplog.text


def test_a_unit_that_is_not_there_is_silent() -> None:
    bus, _ = line()
    assert bus.answer(2, POLL_PDU).pdu is None
    assert bus.answer(255, POLL_PDU).pdu is None
    assert bus.answer(1, b"").pdu is None


def test_a_broadcast_writes_everywhere_and_nobody_answers() -> None:
    bus, _ = line()
    assert bus.answer(0, write_request(0x10E, [77])).pdu is None
    assert bus.answer(0, POLL_PDU).pdu is None
    assert bus.answer(0, b"\x06\x01").pdu is None
    for device in (bus.devices[1], bus.devices[7]):
        assert isinstance(device, FakeDevice)
        device.step()
        assert device.words[0x10E] == 77


def test_a_device_that_is_unit_0_is_asked_and_nobody_else() -> None:
    own, other = FakeDevice(), FakeDevice()
    bus = Bus({0: own, 1: other})
    assert bus.answer(0, POLL_PDU).pdu is not None
    assert bus.answer(0, write_request(0x10D, [5000])).pdu is not None
    assert (own.telegrams, other.telegrams) == (2, 0)


def test_a_broadcast_does_not_pass_a_pulled_cable() -> None:
    bus, device = line(LineFault(LineFaultMode.CABLE_PULLED))
    bus.answer(0, write_request(0x10E, [77]))
    assert (device.pending, device.telegrams) == ([], 0)
    assert bus.devices[7].pending


def test_a_pulled_cable_is_silent_and_starves_the_watchdog() -> None:
    bus, device = line(LineFault(LineFaultMode.CABLE_PULLED))
    assert bus.answer(1, write_request(0x10D, [1])).pdu is None
    assert (device.telegrams, device.pending) == (0, [])
    assert bus.answer(7, POLL_PDU).pdu is not None, "the neighbour's cable is whole"


def test_a_slow_device_acts_now_and_answers_late() -> None:
    bus, device = line(LineFault(LineFaultMode.SLOW, delay_ms=300))
    answer = bus.answer(1, write_request(0x10D, [1]))
    assert answer.delay == pytest.approx(0.305)
    assert answer.pdu == write_request(0x10D, [1])
    assert device.pending == [(0x10D, 1)]


def test_a_silent_device_heard_and_acted_for_as_many_requests_as_asked() -> None:
    bus, device = line(LineFault(LineFaultMode.SILENT, count=2))
    assert bus.answer(1, write_request(0x10D, [1])).pdu is None
    assert bus.answer(1, POLL_PDU).pdu is None
    assert bus.answer(1, POLL_PDU).pdu is not None
    assert (device.telegrams, device.pending) == (3, [(0x10D, 1)])
    assert device.line_fault.mode == LineFaultMode.NONE


def test_a_fault_without_count_stays_until_it_is_cleared() -> None:
    bus, device = line(LineFault(LineFaultMode.SILENT))
    assert all(bus.answer(1, POLL_PDU).pdu is None for _ in range(50))
    device.line_fault.mode = LineFaultMode.NONE
    assert bus.answer(1, POLL_PDU).pdu is not None


def test_a_wrong_unit_answers() -> None:
    bus, _ = line(LineFault(LineFaultMode.WRONG_UNIT))
    answer = bus.answer(1, POLL_PDU)
    assert (answer.unit, answer.corrupt) == (2, "unit")


@pytest.mark.parametrize("count", [1, 2, 25, 125])
def test_a_wrong_length_is_well_formed_and_still_found(count: int) -> None:
    device = FakeDevice(line_fault=LineFault(LineFaultMode.WRONG_LENGTH), words=dict.fromkeys(range(200), 5))
    answer = Bus({1: device}).answer(1, read_request(0, count)).pdu
    assert answer is not None
    assert answer[1] == len(answer) - 2 != 2 * count
    with pytest.raises(BadAnswer):
        parse_answer(Request(3, 0, count), answer)


def test_a_wrong_length_of_an_echo_is_one_byte_short() -> None:
    bus, _ = line(LineFault(LineFaultMode.WRONG_LENGTH))
    pdu = write_request(0x10D, [1])
    assert bus.answer(1, pdu).pdu == pdu[:-1]


def test_garbage_is_a_bad_check_sum_or_noise() -> None:
    bus, device = line(LineFault(LineFaultMode.GARBAGE))
    assert bus.answer(1, POLL_PDU).corrupt == "crc"
    device.line_fault.argument = 1
    for _ in range(200):
        answer = bus.answer(1, POLL_PDU)
        assert answer.corrupt == "garbage" and answer.pdu is not None and len(answer.pdu) == 52
        with pytest.raises(BadAnswer):
            parse_answer(POLL, answer.pdu)


@pytest.mark.parametrize("code", [1, 2, 3, 4, 6, 8])
def test_the_instructor_chooses_an_exception(code: int) -> None:
    bus, device = line(LineFault(LineFaultMode.EXCEPTION, argument=code))
    assert bus.answer(1, write_request(0x10D, [1])).pdu == bytes((0x86, code))
    assert not device.pending
    assert device.telegrams == 1


@pytest.mark.parametrize("mode", list(LineFaultMode))
def test_training_registers_answer_whatever_the_fault_and_cost_no_count(mode: LineFaultMode) -> None:
    bus, device = line(LineFault(mode, delay_ms=900, argument=4, count=1))
    answer = bus.answer(1, read_request(BASE, 1))
    assert (answer.unit, answer.pdu, answer.delay, answer.corrupt) == (1, b"\x03\x02\x50\x47", 0.005, "")
    assert bus.answer(1, write_request(BASE + 0x11, [0])).pdu is not None
    assert (device.line_fault.count, device.telegrams) == (1, 0)


REQUEST = st.one_of(
    st.binary(max_size=260),
    st.builds(lambda f, rest: bytes((f,)) + rest, st.sampled_from([3, 4, 6, 16, 23]), st.binary(max_size=12)),
    st.builds(read_request, st.integers(0, 0xFF00), st.integers(1, 125)),
    st.builds(lambda a, w: write_request(a, [w]), st.integers(0, 0xFFFF), st.integers(0, 0xFFFF)),
)


@given(
    st.integers(-1, 260),
    REQUEST,
    st.builds(LineFault, st.integers(0, 9), st.integers(0, 65535), st.integers(0, 65535), st.integers(0, 3)),
)
def test_nothing_that_is_asked_can_upset_the_line(unit: int, pdu: bytes, fault: LineFault) -> None:
    bus, device = line(fault)
    answer = bus.answer(unit, pdu)
    assert answer.delay >= 0
    if answer.pdu is not None:
        assert unit in bus.devices
        assert 1 <= len(answer.pdu) <= 253
        assert 0 <= answer.unit <= 255
    device.step()
    device.line_fault = LineFault()
    again = bus.answer(1, POLL_PDU).pdu
    assert again is not None and parse_answer(POLL, again) == list(range(100, 125))


async def test_the_memory_road_delivers_what_the_line_lets_through() -> None:
    bus, device = line()
    answer = await exchange(bus, 1, POLL_PDU)
    assert answer is not None and parse_answer(POLL, answer) == list(range(100, 125))
    assert await exchange(bus, 3, POLL_PDU) is None
    for mode in (LineFaultMode.WRONG_UNIT, LineFaultMode.GARBAGE):
        device.line_fault.mode = mode
        with pytest.raises(BadAnswer):
            await exchange(bus, 1, POLL_PDU)
    device.line_fault = LineFault(LineFaultMode.GARBAGE, argument=1)
    noise = await exchange(bus, 1, POLL_PDU)
    assert noise is not None
    with pytest.raises(BadAnswer):
        parse_answer(POLL, noise)
