"""Where a mailbox is stands in `[mailbox]` of device.toml; a device that could not carry a request is told."""

from pathlib import Path

import pytest

from app.plant.definitions import Device, MailboxMap
from app.plant.mailbox import read_mailbox
from app.plant.tables import Source

TAKES = Device(max_read=125, max_write=123, write_functions=(6, 16))


def found(folder: Path, text: str, device: Device = TAKES) -> tuple[MailboxMap | None, list[str]]:
    (folder / "device.toml").write_text(text)
    source = Source(folder / "device.toml", "device.toml")
    map = read_mailbox(source.table(), device)
    return map, [f"{problem.key}: {problem.value}, expected {problem.expected}" for problem in source.problems]


def test_a_mailbox_is_read_and_one_that_is_not_there_is_none(tmp_path: Path) -> None:
    text = "[mailbox]\naddress = 0x0258\nerror = 0x01F2\ntimeout = 2.5\n"
    assert found(tmp_path, text) == (MailboxMap(0x0258, 0x01F2, 2.5), [])
    assert found(tmp_path, "[mailbox]\naddress = 600\n") == (MailboxMap(600, 0, 5.0), [])
    assert found(tmp_path, "[device]\n") == (None, [])


@pytest.mark.parametrize(
    ("text", "device", "says"),
    [
        ("error = 1", TAKES, "mailbox.address"),
        ("address = 0xFFF0", TAKES, "mailbox.address: 65520, expected a whole number from 0 to 65414"),
        ("address = 1\ntimeout = 0", TAKES, "mailbox.timeout: 0"),
        ("address = 1\nwindow = 2", TAKES, "mailbox.window"),
        (
            "address = 1",
            Device(max_write=121, write_functions=(16,)),
            'mailbox: "max_read / max_write / write_functions"',
        ),
        ("address = 1", Device(max_read=121, max_write=123, write_functions=(16,)), "122 registers at once"),
        ("address = 1", Device(max_write=123, write_functions=(6,)), "written with function 16"),
    ],
)
def test_what_cannot_be_is_told(tmp_path: Path, text: str, device: Device, says: str) -> None:
    _, problems = found(tmp_path, f"[mailbox]\n{text}\n", device)
    assert len(problems) == 1 and says in problems[0], problems
