"""Which telegrams an E800 refuses by its map alone: functions, addresses, counts and words."""

from app.errors import DeviceException
from app.sim.eura_e800.parameters import BY_ADDRESS
from app.sim.eura_e800.registers import AO1, AO2, DO1, DO2, FIRST, LAST, LOCK, RELAY


def is_status(address: int) -> bool:
    """Whether `address` is one of the read-only words 0x1000–0x1018."""
    return FIRST <= address <= LAST


def check_read(function: int, address: int, count: int, *, most_status: int, most_parameters: int) -> None:
    """Function 03 of the read-only words or of parameters; `most_…`: registers per telegram.

    Raises:
        DeviceException: 01 other function, 02 unknown or write-only address, 03 more registers than the drive gives.
    """
    if function != 3:
        raise DeviceException(1, f"E800: function {function:02d}, expected 03")
    status = is_status(address)
    if not status and address not in BY_ADDRESS:
        raise DeviceException(2, f"E800: register 0x{address:04X} is not read")
    limit = most_status if status else most_parameters
    if not 1 <= count <= limit:
        raise DeviceException(3, f"E800: {count} registers from 0x{address:04X}, expected 1 to {limit}")
    if status and address + count - 1 > LAST:
        raise DeviceException(2, f"E800: 0x{address:04X} + {count} goes beyond 0x{LAST:04X}")
    if not status and any(at not in BY_ADDRESS for at in range(address, address + count)):
        raise DeviceException(2, f"E800: not all of 0x{address:04X} + {count} are parameters")


def check_function(function: int, count: int, *, multiple_writes: bool) -> None:
    """Function 06 of one word, 16 where switched on.

    Raises:
        DeviceException: 01 other function, 03 a number of words that it does not carry.
    """
    if function != 6 and not (function == 16 and multiple_writes):
        raise DeviceException(1, f"E800: function {function:02d}, expected 06")
    if not count or (function == 6 and count != 1):
        raise DeviceException(3, f"E800: {count} words with function {function:02d}")


def check_output(address: int, word: int) -> None:
    """The lock word and the outputs.

    Raises:
        DeviceException: 02 not a register that is written, 03 value.
    """
    if address == LOCK:
        if not 1 <= word <= 4:
            raise DeviceException(3, f"E800: lock word {word}, expected 1 to 4")
    elif address in (AO1, AO2):
        if word > 1000:
            raise DeviceException(3, f"E800: analog output {word}, expected 0 to 1000")
    elif address in (DO1, DO2, RELAY):
        if word > 1:
            raise DeviceException(3, f"E800: token output {word}, expected 0 or 1")
    else:
        raise DeviceException(2, f"E800: register 0x{address:04X} is not written")
