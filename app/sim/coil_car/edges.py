"""What the coil car's PLC tells of its line: everything that has changed since the last scan, as events."""

from collections.abc import Mapping

from app.sim.coil_car.interlock import InterlockedCar
from app.sim.coil_car.register_map import CoilCarEvent

SEEN = (
    *("emergency_stop", "guard_1", "guard_2", "guard_3", "drive_1", "drive_2", "pump", "pressure", "oil"),
    *("mandrel", "winding", "finished", "coil", "load", "saddle_1", "saddle_2", "saddle_3"),
    *("hit", "limit_1", "limit_2", "limit_3", "limit_4"),
)
"""What is looked at in every scan."""


class Edges:
    """What was seen of one line in the last scan."""

    def __init__(self, car: InterlockedCar) -> None:
        self._car = car
        self._seen: tuple[float, ...] = ()
        """A value for each of `SEEN`."""

    def take_stock(self) -> None:
        """What is so now is not news."""
        machine, values, plausible = self._car.machine, self._car.values, self._car.interlock.plausible
        self._seen = (
            machine.emergency_stop,
            machine.guard(1),
            machine.guard(2),
            machine.guard(3),
            machine.drive_ready(1),
            machine.drive_ready(2),
            machine.pump,
            machine.pressure >= values["least_pressure"],
            machine.oil >= values["least_oil_temperature"],
            machine.mandrel,
            machine.winding,
            machine.finished,
            machine.coil,
            machine.load,
            *machine.saddles,
            machine.hit,
            plausible(1),
            plausible(2),
            plausible(3),
            plausible(4),
        )

    def look(self) -> None:
        """Tell what has changed since the last scan."""
        seen = self._seen
        self.take_stock()
        if self._seen == seen:
            return
        before, now, machine = (
            dict(zip(SEEN, seen, strict=True)),
            dict(zip(SEEN, self._seen, strict=True)),
            self._car.machine,
        )

        def edge(name: str, rise: CoilCarEvent, fall: CoilCarEvent, source: int = 0, value: float = 0.0) -> None:
            if now[name] != before[name]:
                self._car.event(rise if now[name] else fall, source, value)

        edge("emergency_stop", CoilCarEvent.EMERGENCY_STOP, CoilCarEvent.EMERGENCY_STOP_OFF)
        for n in (1, 2, 3):
            edge(f"guard_{n}", CoilCarEvent.GUARD_CLOSED, CoilCarEvent.GUARD_OPENED, n)
        for n in (1, 2):
            edge(f"drive_{n}", CoilCarEvent.DRIVE_READY, CoilCarEvent.DRIVE_TRIPPED, n)
        edge("pump", CoilCarEvent.PUMP_ON, CoilCarEvent.PUMP_OFF)
        edge("pressure", CoilCarEvent.PRESSURE_BACK, CoilCarEvent.PRESSURE_LOW, 0, machine.pressure)
        edge("oil", CoilCarEvent.OIL_WARM, CoilCarEvent.OIL_COLD, 0, machine.oil)
        for n in (1, 2, 3, 4):
            at = machine.x if n < 3 else machine.v
            edge(f"limit_{n}", CoilCarEvent.LIMIT_PLAUSIBLE, CoilCarEvent.LIMIT_IMPLAUSIBLE, n, at)
        if now["mandrel"] != before["mandrel"] and now["mandrel"] != 1:
            self._car.event(CoilCarEvent.EXPANDED if now["mandrel"] else CoilCarEvent.COLLAPSED)
        if now["winding"] != before["winding"]:
            if now["winding"]:
                self._car.event(CoilCarEvent.WINDING, 0, machine.coil)
            elif not machine.finished:
                self._car.event(CoilCarEvent.WINDING_STOPPED, 0, machine.coil)
        if now["finished"] and not before["finished"]:
            if before["load"] and not now["load"]:
                self._car.event(CoilCarEvent.COIL_ON_MANDREL, 0, machine.coil)
            else:
                self._car.coils_wound = self._car.coils_wound + 1 & 0xFFFFFFFF
                self._car.event(CoilCarEvent.COIL_READY, 0, machine.coil)
        self._look_at_coils(before, now)
        if now["hit"] and not before["hit"]:
            self._car.event(CoilCarEvent.COLLISION, int(now["hit"]), machine.x)

    def _look_at_coils(self, before: Mapping[str, float], now: Mapping[str, float]) -> None:
        gained = now["load"] and not before["load"]
        lost = before["load"] and not now["load"]
        source = 0
        for n in (1, 2, 3):
            name = f"saddle_{n}"
            if now[name] and not before[name] and lost:
                self._car.coils_done = self._car.coils_done + 1 & 0xFFFFFFFF
                self._car.event(CoilCarEvent.COIL_LAID, n, now[name])
            elif before[name] and not now[name]:
                if gained:
                    source = n
                else:
                    self._car.event(CoilCarEvent.COIL_REMOVED, n, before[name])
        if gained:
            self._car.event(CoilCarEvent.COIL_ON_CAR, source, now["load"])
