"""What the gate keeps of a machine: it goes on over a reload, or ends with the machine."""

from dataclasses import replace

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
