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
