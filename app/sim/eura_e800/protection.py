"""When an E800 trips: its levels, what keeps a fault from being reset, and the fault that an instructor causes."""

from dataclasses import dataclass

from app.sim.eura_e800.faults import LU, OC, OE, OH, OL1, OL2, PATIENCE

OC_LEVEL = 2.0
"""Over-current trip [1 = rated current of the drive]."""
OE_LEVEL, OE_RESET = 400.0, 385.0
"""Over-voltage trip, and below what it can be reset [V DC]."""
LU_LEVEL, LU_RESET = 190.0, 210.0
OH_LEVEL, OH_RESET = 85.0, 80.0
"""[°C]"""
OVERLOAD_RESET = 0.95
"""Part of the overload image below which the trip can be reset; 2.6 s at standstill."""


@dataclass(frozen=True, slots=True)
class Measured:
    """What the protection looks at."""

    current: float
    """Output [1 = rated of the drive]."""
    bus_voltage: float
    """[V DC], as a drive of 230 V has it: one of 400 V has its levels as much higher."""
    heat_sink: float
    """[°C]"""
    drive_overload: float
    motor_overload: float
    """Images that trip at 1."""
    on: bool
    """Whether the inverter feeds the motor."""


@dataclass(slots=True)
class Protection:
    """The fault that stands, and the one that is caused."""

    fault: int = 0
    """Status code, 0 = none."""
    injected: int = 0
    """Status code that the instructor causes, 0 = none."""
    _injected_for: float = 0.0

    def inject(self, code: int) -> None:
        """Cause `code` from now on, 0 ends it; the physics has `PATIENCE` to trip by itself."""
        self.injected, self._injected_for = code, 0.0

    def step(self, measured: Measured, dt: float) -> int:
        """Status code that trips in this step of `dt` [s], 0 = none; while a fault stands, no other comes."""
        if self.fault:
            return 0
        if tripped := self._physical(measured):
            return tripped
        if not self.injected:
            return 0
        self._injected_for += dt
        late = not measured.on or self._injected_for > PATIENCE.get(self.injected, 0.0)
        return self.injected if late else 0

    def _physical(self, it: Measured) -> int:
        # An injected overload of one kind must not trip the other, which fills just as fast.
        for code, there in (
            (OC, it.current > OC_LEVEL),
            (OE, it.bus_voltage > OE_LEVEL),
            (LU, it.bus_voltage < LU_LEVEL),
            (OH, it.heat_sink > OH_LEVEL),
            (OL2, it.on and it.motor_overload >= 1.0 and self.injected != OL1),
            (OL1, it.on and it.drive_overload >= 1.0 and self.injected != OL2),
        ):
            if there:
                return code
        return 0

    def cause_persists(self, it: Measured) -> bool:
        """Whether the fault that stands would come back at once."""
        fault = self.fault
        if not fault:
            return False
        return (
            fault == self.injected
            or (fault == OE and it.bus_voltage >= OE_RESET)
            or (fault == LU and it.bus_voltage <= LU_RESET)
            or (fault == OH and it.heat_sink >= OH_RESET)
            or (fault == OL1 and it.drive_overload >= OVERLOAD_RESET)
            or (fault == OL2 and it.motor_overload >= OVERLOAD_RESET)
        )
