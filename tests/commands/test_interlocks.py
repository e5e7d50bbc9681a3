"""Why not: every reason by name, with how it stands and since when."""

from tests.commands.stand import ANA, VIT, Stand, refusal


async def test_why_not_names_every_reason_and_the_first_missing_one_first() -> None:
    stand = Stand()
    stand.set_drive(status=9, f203=3)
    reasons = stand.gate.why_not(VIT, "m1", "forward")
    assert [reason.key for reason in reasons[:2]] == ["why.role", "why.no_token"]
    assert [reason.label for reason in reasons[2:]] == [
        "permissive.no_fault",
        "permissive.frequency_source",
        "interlock.overheat",
    ]
    assert next(r.key for r in stand.gate.why_not(None, "m1", "forward")) == "why.signed_out"
    stand.gate.control.take(ANA, "m1")
    refused = await refusal(stand, ANA, "forward")
    assert refused.params["label"] == "permissive.no_fault"
    assert "interlock.overheat" in refused.params["missing"]  # type: ignore[operator]


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
