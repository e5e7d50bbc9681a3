"""Links of a plant file: each mistake names file, line, key, value and expectation."""

from pathlib import Path

import pytest

from tests.plant.design import DESIGN, changed, loaded, mistakes

MISTAKES = [
    ('"rtu"', '"rtv"', "links.press_shop.transport", '"rtv"', "one of memory, tcp, rtu"),
    ('transport = "rtu"', "", "links.press_shop.transport", "missing", "a text"),
    ('port = "/dev/ttyUSB0"', "", "links.press_shop.port", "missing", "/dev/ttyUSB0"),
    ('"rtu"', '"tcp"', "links.press_shop.port", '"/dev/ttyUSB0"', "a whole number from 1 to 65535"),
    ("9600", "9601", "links.press_shop.baud", "9601", "9600"),
    ("9600", '"9600"', "links.press_shop.baud", '"9600"', "9600"),
    ("9600", "9600.0", "links.press_shop.baud", "9600.0", "9600"),
    ("9600", "true", "links.press_shop.baud", "true", "9600"),
    ('"even"', '"evil"', "links.press_shop.parity", '"evil"', "none, even, odd"),
    ('"even"', '["even"]', "links.press_shop.parity", '["even"]', "none, even, odd"),
    ("writes = false", 'writes = "no"', "links.press_shop.writes", '"no"', "true or false"),
    ("writes = false", "wirtes = false", "links.press_shop.wirtes", "false", "perhaps writes"),
    ("writes = false", "fast = 0", "links.press_shop.fast", "0", "from 0.01 to 3600"),
    ("writes = false", "fast = 3\nslow = 2", "links.press_shop.fast", "3", "at most `slow`, 2 s"),
    ("writes = false", "stop_bits = 3", "links.press_shop.stop_bits", "3", "from 1 to 2"),
    *(
        (
            '"rtu"            # memory | tcp | rtu\nport = "/dev/ttyUSB0"',
            f'"tcp"\nhost = "{host}"',
            "links.press_shop.host",
            shown,
            "a host name or an address",
        )
        for host, shown in (
            ("plc..hall", '"plc..hall"'),
            ("http://plc", '"http://plc"'),
            ("10.0.0.7:502", '"10.0.0.7:502"'),
            ("10.0.0.300", '"10.0.0.300"'),
            ("a b", '"a b"'),
            ("10.0.0.7\\n", '"10.0.0.7\\x0a"'),
        )
    ),
    ("[links.press_shop]", "[links.Press-Shop]", "links.Press-Shop", '"Press-Shop"', "small letters"),
]


@pytest.mark.parametrize(("old", "new", "key", "value", "expected"), MISTAKES)
def test_each_mistake_names_file_line_key_value_and_expectation(
    tmp_path: Path, old: str, new: str, key: str, value: str, expected: str
) -> None:
    text = changed(old, new)
    problems = mistakes(tmp_path, text)
    found = next((problem for problem in problems if problem.key == key), None)
    assert found, problems
    assert (found.file, found.value) == ("plant.toml", value)
    assert expected in found.expected
    if value != "missing":
        assert found.line
        names = key.split(".")
        assert names[1 if names[0] == "plant" else min(2, len(names) - 1)] in text.splitlines()[found.line - 1]


def test_tcp_port_is_a_number_and_stop_bits_follow_parity(tmp_path: Path) -> None:
    tcp = changed(
        '"rtu"            # memory | tcp | rtu\nport = "/dev/ttyUSB0"', '"tcp"\nhost = "10.0.0.7"\nport = 1502'
    )
    link = loaded(tmp_path, tcp).links["press_shop"]
    assert (link.host, link.tcp_port) == ("10.0.0.7", 1502)
    assert loaded(tmp_path, changed('"even"', '"none"')).links["press_shop"].stop_bits == 2


@pytest.mark.parametrize("port", ["/dev/ttyUSB0", "/dev/../dev/ttyUSB0"])
def test_a_serial_device_is_of_one_link(tmp_path: Path, port: str) -> None:
    """The one that opened it first had it; the other was down for ever."""
    second = DESIGN[DESIGN.index("[links") : DESIGN.index("[equipment")].replace("press_shop", "hall")
    (problem,) = mistakes(tmp_path, DESIGN + second.replace("/dev/ttyUSB0", port))
    assert (problem.key, problem.value) == ("links.hall.port", f'"{port}"')
    assert problem.expected == "a serial device that no other link has; press_shop has it"
    assert len(loaded(tmp_path, DESIGN + second.replace("ttyUSB0", "ttyUSB1")).links) == 2
