"""What is likely wrong with a serial line on which nothing is understood, from what its port counts and what was heard on it."""

from collections.abc import Callable

import serial  # type: ignore[import-untyped]

from app.links.contract import Counts
from app.links.port_errors import PortErrors, port_errors
from app.plant.definitions import Link


class LineDiagnosis:
    """Of one line, from each opening of its port on."""

    def __init__(self, link: Link, counts: Callable[[], Counts]) -> None:
        """What it finds is kept in what `counts` gives: `strange`, `parity`, `framing`."""
        self._link, self._counts = link, counts
        self._errors = PortErrors()
        """What the port had counted when it was opened."""
        self._understood = False
        """Whether a telegram was heard since then."""

    def opened(self, port: serial.Serial) -> None:
        """Nothing has been heard through `port` yet."""
        self._understood = False
        counts = self._counts()
        counts.parity, counts.framing, counts.strange = 0, 0, False
        self._errors = port_errors(port) or PortErrors()

    def understood(self) -> None:
        """A telegram with a good check sum was heard."""
        self._understood, self._counts().strange = True, False

    def noise(self, port: serial.Serial | None) -> None:
        """Many bytes were heard that are no telegram."""
        counts = self._counts()
        counts.strange = not self._understood
        if (counted := port_errors(port)) is not None:
            errors = counted.since(self._errors)
            counts.parity, counts.framing = errors.parity, errors.framing

    @property
    def hint(self) -> str:
        """The end of an error's text; empty when there is nothing to say."""
        link, counts = self._link, self._counts()
        settings = f"{link.baud} baud, parity {link.parity}, {link.stop_bits} stop bit{'s' * (link.stop_bits > 1)}"
        if counts.parity or counts.framing:
            return f"; {counts.parity} parity and {counts.framing} framing errors: has the device {settings}?"
        if counts.strange:
            return (
                f"; no telegram was heard since the port was opened: has the device {settings}? Are A and B exchanged?"
            )
        return ""
