"""What breaks a simulated device: every fault has a name, and nothing is written to what does not say that it is simulated."""

import pytest

from app.errors import ConfigurationError
from app.links.inject import LINE_FAULTS, injection
from app.sim.eura_e800.faults import FAULTS
from app.sim.training import LINE_FAULT_MODES


def test_every_line_fault_has_a_name_and_every_machine_fault_that_of_the_keypad() -> None:
    assert sorted(LINE_FAULTS.values()) == [mode for mode in LINE_FAULT_MODES if mode]
    names = {keypad: code for code, (keypad, _) in FAULTS.items()}
    assert injection("oc", names).writes == ((0xE010, 4),)
    assert injection("0x09", names).writes == injection("OH", names).writes == ((0xE010, 9),)
    assert injection("slow", names, delay=700, count=2).writes == ((0xE012, 700), (0xE013, 0), (0xE014, 2), (0xE011, 2))
    assert injection("exception", names, code=6).writes[1] == (0xE013, 6)
    with pytest.raises(ConfigurationError, match=r"fault fire: expected one of OC, .*cable, .*clear"):
        injection("fire", names)
