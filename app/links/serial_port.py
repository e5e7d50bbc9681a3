"""A serial device for one program alone: opened, locked, given back, and in words what is wrong with it."""

import contextlib
import errno
import fcntl
import os
import termios
from pathlib import Path

import serial  # type: ignore[import-untyped]

from app.errors import NotConnected
from app.plant.definitions import Link

PARITIES = {"none": serial.PARITY_NONE, "even": serial.PARITY_EVEN, "odd": serial.PARITY_ODD}


class NotSupported(NotConnected):
    """The port is there and does not take this speed or parity."""


def open_port(link: Link) -> serial.Serial:
    """The serial device of `link`, for us alone: a lock that other programs of this kind heed, and TIOCEXCL for all the others.

    Raises:
        NotSupported: the port does not take this speed or parity.
        NotConnected: names the port, what is wrong and what helps.
    """
    if link.parity not in PARITIES:
        raise NotConnected(f"{link.port}: parity {link.parity}, expected one of {', '.join(PARITIES)}")
    try:
        port = serial.Serial(
            link.port,
            link.baud,
            parity=PARITIES[link.parity],
            stopbits=link.stop_bits,
            timeout=0,
            exclusive=True,
        )
    except termios.error as error:
        raise NotSupported(
            f"{link.port}: does not take {link.baud} baud, parity {link.parity} ({error.args[-1]})"
        ) from error
    except (OSError, ValueError) as error:  # SerialException is an OSError
        raise NotConnected(f"{link.port}: {reason_of(error)}") from error
    with contextlib.suppress(OSError, termios.error, ValueError, AttributeError, NotImplementedError):
        port.set_low_latency_mode(True)
    with contextlib.suppress(OSError, termios.error):
        if not _is_pseudo_terminal(link.port):  # there the mark would stay when we are killed
            fcntl.ioctl(port.fileno(), termios.TIOCEXCL)
        port.reset_input_buffer()
    return port


def parity_of(port: serial.Serial) -> str:
    """The parity that the open port has, which is not always the one it was asked for: a pseudo-terminal has none."""
    flags = termios.tcgetattr(port.fileno())[2]
    if not flags & termios.PARENB:
        return "none"
    return "odd" if flags & termios.PARODD else "even"


def leads_elsewhere(path: str, port: serial.Serial) -> bool:
    """Whether another device than the one that `port` has open lies under its name now; False while none does."""
    try:
        return Path(path).stat().st_rdev != os.fstat(port.fileno()).st_rdev
    except OSError:
        return False


def close_port(port: serial.Serial) -> None:
    """Give it back without waiting for what could not be sent."""
    with contextlib.suppress(OSError, termios.error):
        port.reset_output_buffer()
        fcntl.ioctl(port.fileno(), termios.TIOCNXCL)
    with contextlib.suppress(OSError, termios.error):
        port.close()


REASONS: dict[int, str] = {
    errno.ENOENT: "no such device; is the adapter plugged in?",
    errno.ENODEV: "no such device; is the adapter plugged in?",
    errno.ENXIO: "no such device; is the adapter plugged in?",
    errno.EACCES: "permission denied; the user of this program has to be in the group dialout",
    errno.EPERM: "permission denied; the user of this program has to be in the group dialout",
    errno.EBUSY: "in use by another program",
    errno.EAGAIN: "in use by another program",
    errno.ENOTTY: "is not a serial device",
    errno.EIO: "the device is gone",
}
"""What helps, by error number of the system."""


def reason_of(error: BaseException) -> str:
    """What is wrong and what helps; pyserial keeps the number of the system's error in different places."""
    number = getattr(error, "errno", None)
    cause = error.__context__
    if number is None and cause is not None:
        number = cause.args[0] if cause.args and isinstance(cause.args[0], int) else getattr(cause, "errno", None)
    if number is None:
        return str(error)
    text = REASONS.get(number) or os.strerror(number)
    return f"{text} ({errno.errorcode.get(number, number)})"


def _is_pseudo_terminal(path: str) -> bool:
    return str(Path(path).resolve()).startswith("/dev/pts/")
