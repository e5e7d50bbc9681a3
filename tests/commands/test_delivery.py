"""What the gate says when a device rejects a set of setpoints."""

from dataclasses import replace

from app.commands.delivery import outcome_of
from app.commands.lifecycle import ProgressState
from app.errors import Rejected
from tests.links.plc_devices import small


def test_a_rejected_set_of_setpoints_has_failed_with_the_reason_of_the_device() -> None:
    item = small()
    item = replace(item, type=replace(item.type, reasons={21: "outside_limits"}))
    outcome = outcome_of(Rejected("p.b", 21, 2), item, as_code=False)
    assert outcome is not None
    state, text, params = outcome
    assert (state, text) == (ProgressState.FAILED, "why.device_rejected")
    assert (params["label"], params["code"], params["detail"]) == ("reason.outside_limits", 21, 2)
    assert outcome_of(Rejected("p.b", 99), item, as_code=False)[1] == "why.device_rejected_code"
