"""What the gate keeps of a machine: it goes on over a reload, or ends with the machine."""

from collections.abc import Sequence
from dataclasses import replace

import pytest

from app.commands.checks import Checks
from app.errors import Refused
from app.plant.definitions import Scan
from tests.commands.hold_rig import Pressed, moving
from tests.commands.stand import ANA, Stand


async def test_a_reload_keeps_what_is_pending_and_ends_what_is_gone() -> None:
    stand = Stand()
    stand.drives["m1"].deaf = stand.drives["m2"].deaf = True
    await stand.ask(ANA, "forward", "m1")
    await stand.ask(ANA, "forward", "m2")
    left = replace(stand.plant, equipment={"m1": stand.plant.equipment["m1"]})
    stand.gate.configure(left)
    assert [(line.object, line.reason) for line in stand.commands] == [("m2.forward", "why.reloaded")]
    stand.drive().update(status=1, frequency=40.0)
    await stand.pass_time(0.2)
    assert stand.state() == "confirmed"
    assert stand.gate.control.holder("m2") is None


def leave_only(stand: Stand, machine: str) -> None:
    """The plant file is read anew and has this machine alone."""
    stand.gate.configure(replace(stand.plant, equipment={machine: stand.plant.equipment[machine]}))


def test_of_a_machine_that_is_gone_there_is_nothing_to_read() -> None:
    """A page that is being drawn may ask for it."""
    stand = Stand()
    leave_only(stand, "m2")
    gate = stand.gate
    assert not gate.permissives("m1") and not gate.interlocks("m1") and not gate.history("m1") and not gate.left("m1")
    assert gate.permissives("m2") and gate.interlocks("m2")


async def test_a_machine_that_goes_while_it_is_read_for_a_hold_refuses_it() -> None:
    stand = Stand()
    stand.clock.advance(60)
    stand.publish("m1", Scan.FAST, Scan.SLOW)
    link, read = stand.link, stand.link.refresh

    async def refresh(equipment: str, points: Sequence[str]) -> None:
        await read(equipment, points)
        leave_only(stand, "m2")

    link.refresh = refresh  # type: ignore[method-assign]
    with pytest.raises(Refused) as refused:
        await Pressed(stand).arm()
    assert (refused.value.reason, refused.value.status) == ("why.reloaded", 409)
    assert [(line.object, line.reason) for line in stand.commands] == [("m1.jog_forward", "why.reloaded")]


async def test_a_machine_that_goes_before_the_first_keep_alive_is_not_moved() -> None:
    stand = Stand()
    pressed = await Pressed(stand).arm()
    leave_only(stand, "m2")
    with pytest.raises(Refused) as refused:
        await pressed.hold(0.15)
    assert (refused.value.reason, refused.value.status) == ("why.reloaded", 409)
    assert stand.gate.hold.active("m1") is None
    stand.gate.configure(stand.plant)
    with pytest.raises(Refused):
        await pressed.hold(0.15)
    assert not moving(stand)


async def test_a_command_that_is_another_after_a_reload_is_judged_as_it_is_now() -> None:
    """What was found before the wait is of a plant that is gone."""
    stand = Stand()
    pressed = await Pressed(stand).arm()
    machine = stand.plant.equipment["m1"]
    commands = {key: one for key, one in machine.type.commands.items() if key != "jog_forward"}
    without = replace(machine, type=replace(machine.type, commands=commands))
    stand.gate.configure(replace(stand.plant, equipment={**stand.plant.equipment, "m1": without}))
    with pytest.raises(Refused) as refused:
        await pressed.hold(0.15)
    assert (refused.value.reason, refused.value.status) == ("why.reloaded", 409)
    assert not moving(stand)


@pytest.mark.parametrize("when", ["press", "first keep-alive", "command"])
async def test_a_fault_of_the_house_is_not_told_as_a_reload(when: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A key that is missed in our own code says nothing of the plant file, and has its traceback."""
    stand = Stand()
    pressed = Pressed(stand)
    if when == "first keep-alive":
        await pressed.arm()

    def broken(*asked: object) -> None:
        raise KeyError("forgotten")

    monkeypatch.setattr(Checks, "task", broken)
    with pytest.raises(KeyError):
        if when == "press":
            await pressed.arm()
        elif when == "command":
            await stand.ask(ANA, "forward", "m1")
        else:
            await pressed.hold(0.15)
    assert not stand.commands and not moving(stand)
    assert stand.gate.hold.active("m1") is None
