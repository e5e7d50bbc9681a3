"""What simulated devices have saved to their permanent memory (the ROM of a drive): kept in `pogon.db`, so that it outlives the server."""

import asyncio
import logging
from collections.abc import Callable, Mapping
from typing import Any

from app.errors import StorageError
from app.plant.definitions import Plant
from app.plant.retained import RetainedStates
from app.running.next_plant import simulated_links
from app.sim.device import Permanent
from app.sim.plant import SimPlant

log = logging.getLogger(__name__)

PREFIX = "memory of "
"""Before the place of a device, where it is kept among other retained states."""
PERIOD = 0.25
"""Between two looks whether something was written [s]: a save that a drive has told as done is on the disk that soon."""


class SimulatedMemories:
    """Reads the memories once, and writes those that have changed."""

    def __init__(self, states: RetainedStates, simulation: Callable[[], SimPlant | None]) -> None:
        self._states, self._simulation = states, simulation
        self.found: dict[str, Mapping[str, Any]] = {}
        """By place (`app.sim.plant.place_of`), as last kept."""
        self._seen: dict[str, tuple[Permanent, int]] = {}
        """Place → which device, and how often it was written."""
        self._failed = False

    async def read(self) -> None:
        """Everything that was kept."""
        states = await self._states.read()
        self.found.update(
            {id.removeprefix(PREFIX): state for id, state in states.items() if id.startswith(PREFIX) and state}
        )

    async def simulated(self, plant: Plant, build: Callable[[Plant, list[str]], SimPlant]) -> SimPlant | None:
        """The simulated part of `plant`, with the memories of a former run; None where nothing of it is simulated."""
        links = simulated_links(plant)
        if not links:
            return None
        await self.read()
        return build(plant, links)

    async def run(self) -> None:
        """Keep what is written, for ever, and at the end what is left."""
        try:
            while True:
                await asyncio.sleep(PERIOD)
                await self._try_to_keep()
        finally:
            await self._try_to_keep()

    async def _try_to_keep(self) -> None:
        try:
            await self.keep()
        except StorageError as error:
            if not self._failed:
                log.error("memories of simulated devices not kept reason=%s", error)
            self._failed = True
        else:
            self._failed = False

    async def keep(self) -> None:
        """Keep what was written since.

        Raises:
            StorageError: the disk does not take it; the next call tries again.
        """
        simulation = self._simulation()
        devices = simulation.permanent() if simulation is not None else {}
        marks = {place: (device, device.written) for place, device in devices.items()}
        changed = {place: devices[place].memory() for place, mark in marks.items() if self._seen.get(place) != mark}
        changed = {place: state for place, state in changed.items() if state or place in self.found}
        if changed:
            await self._states.write({PREFIX + place: state for place, state in changed.items()})
            self.found.update(changed)
        self._seen = marks
