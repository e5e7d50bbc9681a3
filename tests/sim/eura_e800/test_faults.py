"""The fault table of the virtual drive: every code can be caused, and those with a physical cause have their time for it."""

import pytest

from app.sim.eura_e800.faults import FAULTS, PATIENCE
from tests.sim.eura_e800.stand import FORWARD, command, drive, go, image, inject


@pytest.mark.parametrize("code", FAULTS)
def test_a_caused_fault_is_shown_within_its_patience_and_not_a_moment_later(code: int) -> None:
    device = command(drive(), FORWARD, 1)
    inject(device, code)
    go(device, PATIENCE.get(code, 0.0) + 0.03)
    assert image(device)[5] & 0xFF == code
    assert image(device)[0] == 0


@pytest.mark.parametrize("code", FAULTS)
def test_at_standstill_no_fault_waits_for_its_physics(code: int) -> None:
    device = drive()
    inject(device, code)
    assert go(device, 0.02).fault == code


def test_each_fault_has_a_keypad_text_of_its_own() -> None:
    assert len({text for text, _ in FAULTS.values()}) == len(FAULTS)
    assert set(PATIENCE) <= set(FAULTS)
