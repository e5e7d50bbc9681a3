"""Parameters of the virtual drive: addresses, ranges, and how they limit one another."""

import pytest

from app.sim.eura_e800.drive import VirtualE800
from app.sim.eura_e800.parameters import COMMISSIONED, PARAMETERS, parameter_address
from tests.sim.eura_e800.stand import drive, put, refusal


@pytest.mark.parametrize(
    ("code", "address"),
    [
        ("F111", 267),
        ("F113", 269),
        ("F114", 0x010E),
        ("F203", 0x0203),
        ("F277", 0x024D),
        ("F280", 0x0250),
        ("F810", 0x080A),
        ("F905", 0x0905),
        ("FA00", 0x0A00),
    ],
)
def test_parameter_address_is_group_and_index(code: str, address: int) -> None:
    assert parameter_address(code) == address
    if code in PARAMETERS:
        assert PARAMETERS[code].address == address


@pytest.mark.parametrize("code", ["", "F11", "114", "F1140", "F0AA", "F1A4", "FB00", "F000"])
def test_no_address_for_what_is_no_parameter(code: str) -> None:
    with pytest.raises(ValueError, match="expected F"):
        parameter_address(code)


def test_all_parameters_of_the_order_are_there() -> None:
    wanted = {"F106", "F131", "F137", "F138", "F139", "F209", "F706", "F707", "F810"}
    wanted |= {f"F{n}" for n in (*range(111, 120), *range(200, 204), *range(277, 281), *range(800, 806))}
    wanted |= {f"F{n}" for n in range(900, 906)}
    assert wanted <= set(PARAMETERS)


@pytest.mark.parametrize("code", sorted(set(PARAMETERS) - {"F111", "F112", "F113", "F124"}))
def test_each_range_holds_at_its_edges(code: str) -> None:
    parameter = PARAMETERS[code]
    device = drive()
    for value in (parameter.low, parameter.high):
        put(device, code, value)
        device.step()
        assert device.parameter(code) == value
        assert device.read(3, parameter.address, 1) == [parameter.encode(value)]
    low, high = parameter.encode(parameter.low), parameter.encode(parameter.high)
    for raw in (low - 1, high + 1):
        if 0 <= raw <= 0xFFFF:
            assert refusal(lambda raw=raw: device.write(6, parameter.address, [raw])) == 3


@pytest.mark.parametrize(("code", "hole"), [("F106", 1), ("F106", 4), ("F203", 7), ("F203", 8)])
def test_holes_in_a_range_are_refused(code: str, hole: int) -> None:
    assert refusal(lambda: drive().write(6, PARAMETERS[code].address, [hole])) == 3


def test_frequencies_limit_one_another() -> None:
    device = drive(F111=60.0, F112=5.0, F113=40.0, F124=10.0)
    edges = {"F113": (5.0, 60.0), "F124": (5.0, 60.0), "F112": (0.0, 40.0), "F111": (40.0, 650.0)}
    for code, (low, high) in edges.items():
        parameter = PARAMETERS[code]
        for outside in (parameter.encode(low) - 1, parameter.encode(high) + 1):
            if outside >= 0:
                assert refusal(lambda o=outside, p=parameter: device.write(6, p.address, [o])) == 3, (code, outside)
        start = device.parameter(code)
        for value in (low, high, start):
            put(device, code, value)
            device.step()
            assert device.parameter(code) == value


def test_commissioned_values_are_told_apart_from_the_makers() -> None:
    assert PARAMETERS["F905"].default == 0.0
    assert VirtualE800().parameter("F905") == COMMISSIONED["F905"] == 1.0
