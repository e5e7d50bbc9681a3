"""The conveyor's commands over its registers: what they do, that they act once, and why one is refused."""

from app.registers.plc_map import AnswerState, real, real_of
from app.sim import training
from app.sim.conveyor.register_map import (
    ConveyorCommand,
    ConveyorState,
)
from tests.sim.conveyor.bench import line, put


async def test_start_and_stop_are_answered_and_told_in_order() -> None:
    on = line()
    await on.fetch()
    await on.start()
    on.go(1)
    stop = await on.order(ConveyorCommand.STOP)
    assert stop.state is AnswerState.RUNNING
    on.go(2)
    assert (await on.answer(stop.id)).state is AnswerState.DONE
    assert await on.codes() == [(41, 0), (30, 0), (33, 0), (31, 0)]
    assert (await on.order(ConveyorCommand.STOP)).state is AnswerState.DONE, "always accepted, standing too"


async def test_choosing_a_mode_moves_nothing() -> None:
    on = line()
    for mode, code in (("AUTOMATIC", 1), ("MANUAL", 2), ("AUTOMATIC", 1)):
        assert (await on.order(ConveyorCommand[mode])).state is AnswerState.DONE
        on.go(5)
        status = await on.status()
        assert (status["mode"], status["automatic"], status["moving"], status["state"]) == (code, 0, 0, 0)
        assert not any(on.device.machine.speeds)
    assert (await on.order(ConveyorCommand.START)).state is AnswerState.DONE
    on.go(1)
    assert all(on.device.machine.speeds)
    assert (await on.order(ConveyorCommand.AUTOMATIC)).state is AnswerState.DONE, "it is that mode already"
    await on.stand()
    status = await on.status()
    assert (status["mode"], status["automatic"]) == (1, 0), "Stop keeps the mode and ends the run"
    on.go(5)
    assert not any(on.device.machine.speeds)


async def test_a_repeated_command_does_nothing_again() -> None:
    on = line()
    first = await on.order(ConveyorCommand.INSERT, real(300.0), real(40.0), id=77)
    assert first.state is AnswerState.DONE
    assert await on.order(ConveyorCommand.INSERT, real(500.0), real(40.0), id=77) == first
    assert list(await on.products()) == [first.detail]


async def test_commands_are_refused_with_their_reason() -> None:
    on = line()
    one = await put(on, 300.0)

    async def reason(code: int, *arguments: int, expected: int = 0) -> int:
        answer = await on.order(code, *arguments, expected=expected)
        assert answer.state is AnswerState.REJECTED
        return answer.reason

    assert await reason(99) == 1
    assert await reason(ConveyorCommand.START) == 6
    await on.done(ConveyorCommand.MANUAL)
    assert await reason(ConveyorCommand.START) == 6
    await on.done(ConveyorCommand.AUTOMATIC)
    assert await reason(ConveyorCommand.START, expected=ConveyorState.AUTOMATIC) == 2
    assert await reason(ConveyorCommand.DELETE, 12345) == 7
    assert await reason(ConveyorCommand.CONFIRM, 12345) == 7
    assert await reason(ConveyorCommand.EDIT, 12345, real(100.0), real(20.0)) == 7
    assert await reason(ConveyorCommand.INSERT, real(310.0), real(30.0)) == 8
    two = await put(on, 400.0)
    assert await reason(ConveyorCommand.EDIT, two, real(305.0), real(30.0)) == 8
    assert await reason(ConveyorCommand.INSERT, real(700.0), real(30.0)) == 9
    assert await reason(ConveyorCommand.INSERT, real(10.0), real(30.0)) == 9
    assert await reason(ConveyorCommand.INSERT, real(float("nan")), real(30.0)) == 9
    assert await reason(ConveyorCommand.INSERT, real(100.0), real(float("inf"))) == 11
    assert await reason(ConveyorCommand.INSERT, real(100.0), real(5.0)) == 11
    assert await reason(ConveyorCommand.EDIT, one, real(300.0), real(151.0)) == 11
    small = line(slots=5)
    for n in range(5):
        await put(small, 100.0 + 60 * n)
    assert (await small.order(ConveyorCommand.INSERT, real(600.0), real(30.0))).reason == 10
    assert (await small.status())["buffer_full"] == 1
    await on.start()
    on.go(1)
    assert await reason(ConveyorCommand.MANUAL) == 12
    assert await reason(ConveyorCommand.EDIT, one, real(100.0), real(30.0)) == 12
    await on.train(training.REG_MACHINE_FAULT, 50)
    assert await reason(ConveyorCommand.START) == 3
    assert await reason(ConveyorCommand.MANUAL) == 3
    await on.train(training.REG_MACHINE_FAULT, 1)
    await on.done(ConveyorCommand.RESET)
    await on.until(lambda: not on.device.machine.speeds[1])
    await on.start()
    await on.until(lambda: on.device.state == ConveyorState.FAULT)
    assert await reason(ConveyorCommand.START) == 4


async def test_records_are_put_edited_confirmed_and_deleted() -> None:
    on = line()
    await on.fetch()
    answer = await on.order(ConveyorCommand.INSERT, real(300.0), real(40.0))
    id = answer.detail
    await on.done(ConveyorCommand.EDIT, id, real(320.0), real(25.5))
    row = (await on.products())[id]
    assert (row["head"], row["tail"], row["length"], row["area"], row["state"]) == (320.0, 294.5, 25.5, 2, 1)
    on.device.power_cycle()
    assert (await on.products())[id]["state"] == 3
    assert (await on.status())["uncertain"] == 1
    await on.done(ConveyorCommand.CONFIRM, 0)
    assert (await on.products())[id]["state"] == 1
    await on.done(ConveyorCommand.DELETE, id)
    assert await on.products() == {}
    assert await on.codes() == [(8, 0), (7, 0), (34, 0), (9, 0), (6, 0)]
    assert on.events[2].snapshot[:2] == (0, id)
    assert real_of(on.events[2].snapshot[4] << 16 | on.events[2].snapshot[5]) == 25.5
