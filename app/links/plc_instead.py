"""A Pogon PLC at the address of a device that has its maker's map: values read from it would look good and mean nothing."""

import logging

from app.errors import BadAnswer, DeviceException, NoAnswer
from app.links.line import Line
from app.links.station import Station
from app.links.training_head import read_head
from app.registers import plc_map
from app.registers.pdu import READ_HOLDING

log = logging.getLogger(__name__)

WORDS = plc_map.AT_TYPE + 1
"""Of the header (registers/plc_map.py): magic, major and minor version, type."""


async def answers_instead(line: Line, station: Station) -> bool:
    """Whether the unit shows the header of a Pogon PLC; False too where nothing can be told. Who is silent there is not asked again.

    Raises:
        NotConnected: the connection is lost.
    """
    device = station.device
    if not device.makers_map or station.mute or READ_HOLDING not in device.read_functions:
        return False
    try:
        words = await read_head(line, station, plc_map.HEADER, WORDS)
    except NoAnswer:
        station.mute = True
        return False
    except (BadAnswer, DeviceException):
        return False
    if (words[plc_map.AT_MAGIC], words[plc_map.AT_MAJOR]) != (plc_map.MAGIC, plc_map.MAJOR):
        return False
    fault = f"a Pogon PLC of type {words[plc_map.AT_TYPE]} answers, expected {station.equipment[0].type.name}"
    if station.faults.new(fault, line.clock.monotonic()):
        log.error("device is not that of the plant file link=%s unit=%d: %s", line.link.name, station.number, fault)
    return True
