"""Commands, hold-to-run and sets of setpoints: executed once or not at all, and the person is told which."""

import asyncio
from collections.abc import Callable

import pytest

from app.errors import DeviceException, LinkError, NoAnswer, NotConnected, Overtaken, Refused, Rejected
from app.registers import plc_map
from app.registers.plc_map import AnswerState, real
from tests.links.devices import until
from tests.links.plc_devices import (
    KINDS,
    LONG,
    NOT_NOW,
    REASON_NOT_NOW,
    START,
    STOP,
    SmallPlc,
    command_of,
    once,
    plant,
)


def is_command(pdu: bytes) -> bool:
    return command_of(pdu) > 0


def reads_answers(pdu: bytes) -> bool:
    return pdu[0] == 3 and int.from_bytes(pdu[1:3], "big") == plc_map.ANSWERS


@pytest.mark.parametrize("kind", KINDS)
async def test_a_command_is_executed_once_and_answered(kind: str) -> None:
    device = SmallPlc()
    async with plant(device, kind) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        answer = await line.link.order("p", START, [real(1.5), 7], expected=1, owner=4)
        assert (answer.state, answer.reason) == (AnswerState.DONE, 0)
        assert device.executed == [(START, (real(1.5), 7, 0, 0))]
        assert await line.link.answer("p", answer.id) == answer
        await until(lambda: line.value("p.state") == 2)
        other = await line.link.order("p", STOP, urgent=True)
        assert other.id != answer.id and other.state is AnswerState.DONE
        assert await line.link.answer("p", 1 if answer.id != 1 else 3) is None


async def test_a_rejection_is_an_answer_with_its_reason() -> None:
    device = SmallPlc()
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        answer = await line.link.order("p", NOT_NOW)
        assert (answer.state, answer.reason, answer.detail) == (AnswerState.REJECTED, REASON_NOT_NOW, 7)
        stale = await line.link.order("p", START, expected=5)
        assert (stale.state, stale.detail) == (AnswerState.REJECTED, 1)
        assert not device.executed


async def test_a_long_command_is_answered_when_it_is_taken_and_asked_about_until_it_is_done() -> None:
    device = SmallPlc()
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        answer = await line.link.order("p", LONG)
        assert answer.state is AnswerState.RUNNING

        async def state() -> AnswerState:
            now = await line.link.answer("p", answer.id)
            return now.state if now else AnswerState.NONE

        assert await state() is AnswerState.RUNNING
        await asyncio.sleep(0.4)
        assert await state() is AnswerState.DONE


@pytest.mark.parametrize("kind", KINDS)
async def test_a_lost_echo_is_looked_up_in_the_answers(kind: str) -> None:
    device = SmallPlc()
    async with plant(device, kind) as (line, bus):
        await until(lambda: line.value("p.state") == 1)
        for value in range(3):
            bus.fault = once("answer", is_command)
            answer = await line.link.order("p", START, [real(value)])
            assert answer.state is AnswerState.DONE
            assert device.starts() == [float(n) for n in range(value + 1)]


@pytest.mark.parametrize("kind", KINDS)
async def test_a_lost_request_has_not_arrived_and_is_not_sent_again(kind: str) -> None:
    device = SmallPlc()
    async with plant(device, kind) as (line, bus):
        await until(lambda: line.value("p.state") == 1)
        bus.fault = once("request", is_command)
        with pytest.raises(LinkError, match="did not arrive") as error:
            await line.link.order("p", START)
        assert not isinstance(error.value, NoAnswer)
        await asyncio.sleep(0.5)
        assert bus.spoiled == 1 and not device.executed
        assert (await line.link.order("p", START)).state is AnswerState.DONE
        assert len(device.executed) == 1


@pytest.mark.parametrize("kind", KINDS)
async def test_a_late_echo_changes_nothing(kind: str) -> None:
    device = SmallPlc()
    async with plant(device, kind) as (line, bus):
        await until(lambda: line.value("p.state") == 1)
        bus.fault = once("late", is_command)
        assert (await line.link.order("p", START, [real(1)])).state is AnswerState.DONE
        await asyncio.sleep(0.6)
        assert (await line.link.order("p", START, [real(2)])).state is AnswerState.DONE
        assert device.starts() == [1.0, 2.0]


@pytest.mark.parametrize("kind", ["memory", "tcp"])
async def test_of_a_command_whose_answers_cannot_be_read_nobody_knows(kind: str) -> None:
    device = SmallPlc()
    async with plant(device, kind) as (line, bus):
        await until(lambda: line.value("p.state") == 1)
        bus.fault = lambda pdu: "answer" if is_command(pdu) or reads_answers(pdu) else ""
        with pytest.raises(NoAnswer, match="nobody knows"):
            await line.link.order("p", START)
        assert len(device.executed) == 1


async def test_torn_answers_are_read_again() -> None:
    device = SmallPlc()
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        device.torn.add(plc_map.ANSWERS)
        asyncio.get_running_loop().call_later(0.2, device.torn.clear)
        assert (await line.link.order("p", START)).state is AnswerState.DONE
        device.torn.add(plc_map.ANSWERS)
        with pytest.raises(LinkError):
            await line.link.answer("p", 5)
        assert line.link.statistics.torn > 3


async def test_a_device_that_restarts_before_it_has_acted_leaves_the_command_unknown() -> None:
    class Forgetful(SmallPlc):
        """Starts anew in place of taking the first command, and has forgotten its answers."""

        def _take_writes(self) -> None:
            if self.boots == 1 and any(address == plc_map.COMMAND for address, _ in self._pending):
                self._command_area.clear()
                self.power_cycle()
            else:
                super()._take_writes()

    device = Forgetful()
    async with plant(device) as (line, bus):
        await until(lambda: line.value("p.state") == 1)
        bus.fault = once("answer", is_command)
        with pytest.raises(NoAnswer, match="nobody knows"):
            await line.link.order("p", START)
        assert not device.executed
        assert (await line.link.order("p", START)).state is AnswerState.DONE
        await until(lambda: line.value("p.boots") == 2)


async def test_two_at_once_are_executed_one_after_the_other() -> None:
    class OnePlace(SmallPlc):
        """A real PLC has one place for a command: what comes before it was taken is overwritten."""

        def write(self, function: int, address: int, words: list[int]) -> None:  # type: ignore[override]
            if address == plc_map.COMMAND:
                self._pending = [w for w in self._pending if w[0] != plc_map.COMMAND]
            super().write(function, address, words)

    device = OnePlace()
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        answers = await asyncio.gather(*(line.link.order("p", START, [real(n)]) for n in range(6)))
        assert [answer.state for answer in answers] == 6 * [AnswerState.DONE]
        assert device.starts() == [float(n) for n in range(6)]
        assert len({answer.id for answer in answers}) == 6


async def test_a_stop_waits_for_nobody_and_nothing_that_waited_comes_after_it() -> None:
    device = SmallPlc()
    async with plant(device) as (line, bus):
        await until(lambda: line.value("p.state") == 1)
        bus.fault = once("request", is_command)
        first = asyncio.create_task(line.link.order("p", START, [real(1)]))
        await asyncio.sleep(0.05)
        waiting = asyncio.create_task(line.link.order("p", START, [real(2)]))
        setting = asyncio.create_task(line.link.write("p", "a", 4.0))
        await asyncio.sleep(0.02)
        began = asyncio.get_running_loop().time()
        assert (await line.link.order("p", STOP, urgent=True)).state is AnswerState.DONE
        assert asyncio.get_running_loop().time() - began < 0.25, "only the telegram on the wire is waited for"
        results = await asyncio.gather(first, waiting, setting, return_exceptions=True)
        assert isinstance(results[0], LinkError) and not isinstance(results[0], NoAnswer)
        assert isinstance(results[1], Overtaken) and isinstance(results[2], Overtaken)
        assert [code for code, _ in device.executed] == [STOP]
        assert device.settings["a"] == 1.0


async def test_the_same_id_is_not_executed_again() -> None:
    device = SmallPlc()
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        first = await line.link.order("p", START, request=9)
        assert await line.link.order("p", START, request=9) == first
        assert len(device.executed) == 1


async def test_what_is_refused_before_it_is_sent() -> None:
    device = SmallPlc()
    async with plant(device, "tcp", writes=False) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        with pytest.raises(Refused):
            await line.link.order("p", START)
        with pytest.raises(Refused):
            await line.link.hold("p", 1, 1)
        with pytest.raises(Refused):
            await line.link.write("p", "a", 4.0)
    async with plant(device, start=False) as (line, _):
        with pytest.raises(NotConnected):
            await line.link.order("p", START)
    assert not device.executed and not device.holds


@pytest.mark.parametrize("kind", KINDS)
async def test_no_command_is_ever_executed_twice_or_lost_unnoticed(kind: str) -> None:
    """Every second telegram of a command or its answers meets a fault; what is told must be what happened."""
    device = SmallPlc()
    faults = ["", "request", "answer", "late", "", "answer"]
    number = 0

    def fault(pdu: bytes) -> str:
        nonlocal number
        if not is_command(pdu):
            return ""
        number += 1
        return faults[number % len(faults)]

    async with plant(device, kind) as (line, bus):
        await until(lambda: line.value("p.state") == 1)
        bus.fault = fault
        done, absent, unknown = [], [], []
        for n in range(18):
            try:
                answer = await line.link.order("p", START, [real(n)])
            except NoAnswer:
                unknown.append(float(n))
            except LinkError:
                absent.append(float(n))
            else:
                assert answer.state is AnswerState.DONE
                done.append(float(n))
        ran = device.starts()
        assert len(set(ran)) == len(ran), "executed twice"
        assert set(done) <= set(ran) and not set(absent) & set(ran)
        assert len(done) >= 12 and len(absent) >= 2 and len(unknown) <= 1, (done, absent, unknown)
        assert number == 18, "each was sent once"


# hold-to-run


async def test_hold_to_run_carries_bits_counter_and_argument() -> None:
    device = SmallPlc()
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        await line.link.hold("p", 0x11, 1, 25.0)
        await until(lambda: device.hold == 0x11)
        assert device.hold_argument == 25.0
        await line.link.hold("p", 0, 2, urgent=True)
        await until(lambda: device.hold == 0)
        assert [hold[:2] for hold in device.holds] == [(0x11, 1), (0, 2)]
        await line.link.hold("p", 1, 3)
        await asyncio.sleep(0.7)
        assert device.hold == 0, "nobody repeats it"


# setpoints


@pytest.mark.parametrize("kind", KINDS)
async def test_setpoints_written_at_once_do_not_lose_each_other(kind: str) -> None:
    device = SmallPlc()
    async with plant(device, kind) as (line, _):
        await until(lambda: line.value("p.c") == 3.0)
        await asyncio.gather(
            line.link.write("p", "a", 4.0), line.link.write("p", "b", 5.0), line.link.write("p", "c", 6.0)
        )
        assert device.settings == {"a": 4.0, "b": 5.0, "c": 6.0, "d": 0.0}
        assert device.commits == 3
        await until(lambda: (line.value("p.a"), line.value("p.b"), line.value("p.c")) == (4.0, 5.0, 6.0))


async def test_a_set_that_the_device_rejects_changes_nothing_and_says_why() -> None:
    device = SmallPlc()
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.c") == 3.0)
        with pytest.raises(Rejected) as error:
            await line.link.write("p", "b", 50.0)
        assert (error.value.reason, error.value.detail, error.value.kind) == (21, 2, "rejected")
        assert device.settings == {"a": 1.0, "b": 2.0, "c": 3.0, "d": 0.0}


FAULTS: dict[str, Callable[[bytes], object]] = {
    "staging": lambda pdu: pdu[0] == 16 and pdu[1:3] == bytes((2, 0x40)),
    "commit": is_command,
}


@pytest.mark.parametrize("what", list(FAULTS))
@pytest.mark.parametrize("how", ["request", "answer", "late"])
async def test_a_set_whose_telegram_is_spoiled_is_all_or_none_and_told(what: str, how: str) -> None:
    device = SmallPlc()
    async with plant(device, "tcp") as (line, bus):
        await until(lambda: line.value("p.c") == 3.0)
        bus.fault = once(how, FAULTS[what])
        if what == "commit" and how != "request":
            await line.link.write("p", "b", 7.0)
            assert device.settings["b"] == 7.0
        else:
            with pytest.raises(LinkError):
                await line.link.write("p", "b", 7.0)
            assert device.settings == {"a": 1.0, "b": 2.0, "c": 3.0, "d": 0.0}
        assert device.commits <= 1
        await line.link.write("p", "a", 8.0)
        assert device.settings["a"] == 8.0 and device.settings["c"] == 3.0


async def test_the_settings_are_composed_from_what_the_device_has_now() -> None:
    device = SmallPlc()
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.c") == 3.0)
        device._settings.values = {
            **device._settings.values,
            "c": 9.0,
        }  # somebody else has changed it, we have not seen it yet
        device._map.forget()
        await line.link.write("p", "a", 4.0)
        assert device.settings == {"a": 4.0, "b": 2.0, "c": 9.0, "d": 0.0}


async def test_a_refused_command_telegram_is_told_as_such() -> None:
    device = SmallPlc()
    async with plant(device) as (line, _):
        await until(lambda: line.value("p.state") == 1)
        device.line_fault.argument = 4

        def refuse(function: int, address: int, words: object) -> None:
            raise DeviceException(4)

        device.write = refuse  # type: ignore[method-assign]
        with pytest.raises(DeviceException):
            await line.link.order("p", START)
