"""What the plant says of a machine now: conditions with how they stand and since when."""

from tests.commands.stand import Stand


async def test_conditions_come_with_how_they_stand_and_since_when() -> None:
    stand = Stand()
    await stand.pass_time(0.3)
    before = {condition.key: (met, since) for condition, met, since in stand.gate.permissives("m1")}
    assert before["no_fault"][0] is True
    await stand.pass_time(5)
    stand.drive()["status"] = 9
    await stand.pass_time(0.3)
    lines = {condition.key: (met, since) for condition, met, since in stand.gate.permissives("m1")}
    assert lines["no_fault"][0] is False
    assert lines["no_fault"][1] > before["no_fault"][1] + 4_000_000
    assert lines["start_source"] == before["start_source"]
    assert {c.key: met for c, met, _ in stand.gate.interlocks("m1")}["overheat"] is False
