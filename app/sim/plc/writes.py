"""What a virtual PLC takes in one write: whole commands, whole hold-to-run requests, single words of its header and ring."""

from collections.abc import Sequence

from app.errors import DeviceException
from app.registers import plc_map


def check_write(device: str, address: int, words: Sequence[int], *, newest: int, staging: range) -> None:
    """Whether `words` may go to `address`; `newest` is the sequence of the last event, `staging` the addresses of staged settings.

    Raises:
        DeviceException: 02 an address that is not written, 03 a value or a number of words that its place does not take.
    """
    end = address + len(words)
    if plc_map.COMMAND <= address < plc_map.COMMAND + plc_map.COMMAND_WORDS:
        if address != plc_map.COMMAND or len(words) != plc_map.COMMAND_WORDS or not words[-1]:
            raise DeviceException(3, f"{device}: a command is one write of 16 words that ends with an id above 0")
    elif plc_map.HOLD <= address < plc_map.HOLD + plc_map.HOLD_WORDS:
        if address != plc_map.HOLD or len(words) != plc_map.HOLD_WORDS:
            raise DeviceException(3, f"{device}: hold-to-run is one write of 4 words")
    elif address == plc_map.EVENTS + plc_map.AT_ACKNOWLEDGED:
        if len(words) != 2 or words[0] << 16 | words[1] > newest:
            raise DeviceException(3, f"{device}: acknowledged is one write of 2 words, at most {newest}")
    elif address == plc_map.HEADER + plc_map.AT_HOST_HEARTBEAT:
        if len(words) != 1:
            raise DeviceException(2, f"{device}: register 0x{address + 1:04X} is not written")
    elif not staging.start <= address < end <= staging.stop:
        raise DeviceException(2, f"{device}: 0x{address:04X} + {len(words)} is not written")
