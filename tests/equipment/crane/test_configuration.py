"""What the crane says of its places is compared with the plant file as far as a register of 32 bits can tell it."""

import struct

import pytest

from app.plant import types
from app.plant.expression import parse


def differs(key: str, given: float, device: float) -> bool | None:
    data, problems = types.read_type("crane", ("hr", "en", "de", "cs"))
    assert not problems
    derived = data.points[key].point.derived
    assert derived
    sentence = parse(derived.when)
    values = {name: 0.0 if name.endswith("_differ") else given for name in sentence.names}
    (register,) = struct.unpack(">f", struct.pack(">f", device))
    return sentence.true(values | {name: register for name in sentence.names if name.startswith("device_")})


@pytest.mark.parametrize(
    "key", ["hoist_places_differ", "trolley_places_differ", "bridge_places_differ", "configuration_differs"]
)
def test_a_number_that_the_register_rounds_is_not_another_one(key: str) -> None:
    assert differs(key, 32.3, 32.3) is False
    assert differs(key, 32.3, 32.4) is True
