"""The simulated plant on a port of Modbus TCP, as POGON_SERVE_MODBUS asks: any client sees the machines that the screens show."""

import logging

from app.addresses import host_and_port
from app.errors import ConfigurationError
from app.sim.bus import Bus
from app.sim.plant import SimPlant, units
from app.sim.server import TcpServer, serve_tcp

log = logging.getLogger(__name__)


class ModbusDoor:
    """Open from the first simulated plant on, until `close`; `wanted` is host:port, empty = never."""

    def __init__(self, wanted: str) -> None:
        self.wanted = wanted
        self._server: TcpServer | None = None
        self._bus: Bus | None = None

    @property
    def address(self) -> tuple[str, int] | None:
        """Where it answers; None = nowhere."""
        return self._server.address if self._server else None

    async def open(self, sim: SimPlant | None) -> None:
        """Serve `sim`, unless it is served already.

        Raises:
            ConfigurationError: the port is not to be had.
        """
        if not self.wanted or self._server is not None:
            return
        if sim is None:
            log.warning("POGON_SERVE_MODBUS=%s: no link of the plant is simulated", self.wanted)
            return
        self._bus = sim.merged()
        try:
            self._server = await serve_tcp(self._bus, *host_and_port(self.wanted))
        except ConfigurationError as error:
            raise ConfigurationError(f"POGON_SERVE_MODBUS={self.wanted}: {error}") from error

    def follow(self, sim: SimPlant | None) -> None:
        """The machines behind the door are those of `sim` now."""
        if self._bus is not None:
            self._bus.devices = dict(units(sim.equipment, sim.devices)) if sim else {}

    async def close(self) -> None:
        """Close it."""
        if self._server is not None:
            await self._server.close()
