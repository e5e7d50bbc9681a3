"""A drive with a mailbox and some registers to scan, a list of parameters behind it, and the machine that reads it."""

from collections.abc import Callable, Sequence
from pathlib import Path

from app.errors import DeviceException
from app.plant.definitions import Device, Equipment, EquipmentType, MailboxMap
from app.profidrive.parameter_access.formats import Format
from app.profidrive.parameter_access.mailbox import WORDS
from app.profidrive.parameter_access.messages import Address, Failed, Request, RequestId, Result, Values, Written
from app.sim.sinamics.gateway import GatewayMailbox
from app.sim.sinamics.mailbox import Mailbox
from app.sim.training import LineFault
from tests.links.devices import point

AT, ERROR = 0x0258, 0x01F2
U16, U32 = Format.UNSIGNED16, Format.UNSIGNED32
DEVICE = Device(
    timeout=0.15,
    fast=0.05,
    slow=0.5,
    max_read=125,
    max_write=123,
    write_functions=(6, 16),
    services=(MailboxMap(AT, ERROR, timeout=1.0),),
)


class MailboxDrive:
    """Parameters 1 to 999 are arrays of 64 words, of which element i of parameter n was n + i; r > 900 are read only."""

    type = "drive"
    dt = 0.01

    def __init__(self, *, gateway: bool = False) -> None:
        """`gateway`: a PLC is between, and the drive on its fieldbus."""
        self.line_fault = LineFault()
        self.mailbox = GatewayMailbox(self.serve) if gateway else Mailbox(self.serve)
        self.fault = 0
        """Of the mailbox (`MailboxFault`)."""
        self.values: dict[tuple[int, int], int] = {}
        self.requests: list[Request] = []
        self.refuses: int | None = None
        """Modbus exception for the next telegram to the mailbox."""
        self.scans = 0
        self.on_request: Callable[[Request], None] = lambda request: None

    def step(self) -> None:
        self.mailbox.step(self.dt, self.fault)

    def telegram_seen(self) -> None:
        pass

    def read(self, function: int, address: int, count: int) -> list[int]:
        if address >= AT and address + count <= AT + WORDS:
            return self.mailbox.words[address - AT : address - AT + count]
        if address == ERROR:
            return [17]
        if address + count > 4:
            raise DeviceException(2)
        self.scans += 1
        return [7, 8, 9, 10][address : address + count]

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        if self.refuses is not None:
            code, self.refuses = self.refuses, None
            raise DeviceException(code)
        if not (address >= AT and address + len(words) <= AT + WORDS):
            raise DeviceException(2)
        self.mailbox.write(address - AT, words)

    def serve(self, request: Request) -> list[Result]:
        self.requests.append(request)
        self.on_request(request)
        if request.id is RequestId.READ:
            return [self._read(address) for address in request.addresses]
        return [self._write(*pair) for pair in zip(request.addresses, request.values or (), strict=True)]

    def _read(self, address: Address) -> Result:
        if not 1 <= address.number <= 999:
            return Failed(0)
        if address.subindex + address.elements > 64:
            return Failed(3, (64,))
        elements = range(address.subindex, address.subindex + address.elements)
        return Values(U16, tuple(self.values.get((address.number, i), address.number + i) for i in elements))

    def _write(self, address: Address, block: Values) -> Result:
        if address.number > 900:
            return Failed(1, (0,))
        for i, value in enumerate(block.values, address.subindex):
            self.values[address.number, i] = int(value)
        return Written()


def drive(device: Device = DEVICE) -> Equipment:
    """The machine `d` on unit 1 with two points that are scanned fast."""
    by_key = {key: point("d", key, n) for n, key in enumerate(("a", "b"))}
    kind = EquipmentType("drive", Path("drive"), "type", device, by_key, {}, (), (), {}, (), {})
    return Equipment("d", kind, "hall", 1, {}, "", by_key, ())
