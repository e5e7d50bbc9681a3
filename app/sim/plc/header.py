"""The header of a virtual PLC's map: who it is, whether it lives, its time and what it can hold."""

from collections.abc import Sequence
from struct import Struct, unpack

from app.registers import plc_map
from app.sim.plc.host import HostWatch
from app.sim.plc.scan_time import ScanTime

CAPACITIES = 9
"""Words 23–31."""

_HEADER = Struct(f">4HI5HQ4HQ{CAPACITIES}H")


class Header:
    """Encodes the header of one device."""

    def __init__(self, type_code: int, capacities: Sequence[int], scan_time: ScanTime, host: HostWatch) -> None:
        """`type_code`: word 3; `capacities`: at most 9, the rest is 0; `scan_time` and `host` are read at every `words`."""
        self._type_code = type_code
        self._capacities = [*capacities, *(0,) * CAPACITIES][:CAPACITIES]
        self._scan_time, self._host = scan_time, host
        self._since = 0

    def start_up(self, scans: int) -> None:
        """The heartbeat begins anew at the count `scans`."""
        self._since = scans

    def words(self, *, configuration: int, boots: int, scans: int, time: int, host_timeout: float) -> Sequence[int]:
        """All words as of now; `configuration`: its check sum, `time` [µs], `host_timeout` [s]."""
        packed = _HEADER.pack(
            plc_map.MAGIC,
            plc_map.MAJOR,
            plc_map.MINOR,
            self._type_code,
            configuration,
            plc_map.SIMULATED | plc_map.WRITABLE,
            boots & 0xFFFF,
            scans - self._since & 0xFFFF,
            self._host.heartbeat,
            min(round(host_timeout * 1000), 0xFFFF),
            time,
            plc_map.TimeQuality.FREE,
            self._scan_time.last,
            self._scan_time.longest,
            self._scan_time.overruns & 0xFFFF,
            scans,
            *self._capacities,
        )
        return unpack(f">{plc_map.HEADER_WORDS}H", packed)
