"""One belt of the conveyor's PLC: ramp, speed selector, measured speed, and the supervision of its drive and its encoder."""

from enum import IntEnum
from math import exp

from app.blocks.pulse_speed import LONGEST, pulse_speed
from app.blocks.ramp_record import RampRecorder
from app.blocks.s_ramp import SRamp
from app.blocks.speed_selector import SpeedSelector
from app.sim.conveyor.machine import DRIVE_TIME
from app.sim.conveyor.register_map import Motor, Source
from app.sim.device import DT

UNCERTAIN_FROM = 1.0
"""A product on a belt whose encoder differs by more from the ramp is uncertain [mm]."""
IMPLAUSIBLE, PULSES_OFF = 0.6, 0.3
"""An encoder has failed when it differs by more than this part of the way in the jam time, and this [mm]."""
DRIVEN = 1.0
"""A drive with a setpoint above this must turn [%]."""
KEPT = LONGEST + 1
"""Scans of which the counts are kept: speeds are measured over them."""
MOVED_SCANS = 10
"""A belt that gave a pulse in so many scans moves."""
FOLLOW = 1 - exp(-DT / DRIVE_TIME)
"""Part of the way to its setpoint that a drive goes in one scan."""


class Finding(IntEnum):
    """What supervision found in this scan."""

    NONE = 0
    DEVIATION = 1
    """Ramp and encoder differ: what lies on the belt is uncertain."""
    ENCODER = 2
    JAM = 3


class Belt:
    """What the program knows of one belt."""

    __slots__ = (
        "_differs",
        "_distance",
        "_distance_of",
        "_history",
        "_jam_age",
        "_model",
        "encoder_fault",
        "jammed",
        "moved",
        "pulses",
        "ramp",
        "record",
        "selector",
        "source",
        "target",
    )

    def __init__(self, pulses: int, acceleration: float, jerk: float) -> None:
        """`pulses` of the encoder now; `acceleration` [%/s], `jerk` [%/s²]."""
        self.ramp = SRamp(acceleration, jerk)
        self.record = RampRecorder()
        self.selector = SpeedSelector()
        self.source = Source.NONE
        self.target = 0.0
        """[%]"""
        self.pulses = pulses
        self.moved = 0.0
        """In this scan [mm]."""
        self.jammed = False
        self.encoder_fault = False
        self._history = [pulses] * KEPT
        self._model = 0.0
        """Speed that the ramp must have given by now [mm/s]."""
        self._differs = 0.0
        """Way that the encoder lacks, fading with the jam time [mm]."""
        self._jam_age = 0.0
        self._distance_of: tuple[float, ...] = ()
        self._distance = 0.0

    def measure(self, pulses: int, pulse_length: float, step: int) -> None:
        """Read the encoder in scan `step`; `pulse_length` [mm]."""
        self.moved = (pulses - self.pulses) * pulse_length
        self.pulses = pulses
        self._history[step % KEPT] = pulses

    def speed(self, pulse_length: float, step: int) -> float:
        """Measured [mm/s]."""
        at = step % KEPT + 1
        counts = (*self._history[:at][::-1], *self._history[at:][::-1])
        return pulse_speed(counts) * pulse_length / DT

    def moves(self, step: int) -> bool:
        """It is driven, or has moved in the last scans."""
        ramp = self.ramp
        return bool(ramp.speed or ramp.acceleration or self._history[(step - MOVED_SCANS + 1) % KEPT] != self.pulses)

    def follow(self, dt: float, time: int, *, supplied: bool) -> None:
        """Let the ramp go on to the target for `dt` [s] at `time` [µs]; without supply it is at 0 at once."""
        ramp, target = self.ramp, self.target
        if not supplied or self.jammed:
            self.record.cut(ramp, time)
            ramp.reset()
        elif ramp.speed != target or ramp.acceleration:
            self.record.begin(target, ramp, time)
            ramp.step(target, dt)
            self.record.follow(ramp)

    def stop_distance(self) -> float:
        """[% s], signed."""
        ramp = self.ramp
        if ramp.speed == 0.0 and ramp.acceleration == 0.0:
            return 0.0
        now = (ramp.speed, ramp.acceleration, ramp.acceleration_limit, ramp.jerk)
        if now != self._distance_of:
            self._distance_of, self._distance = now, ramp.stop_distance()
        return self._distance

    def supervise(self, setpoint: float, scale: float, limited: bool, enabled: bool, jam_time: float) -> Finding:
        """Driven at the torque limit without a pulse: jam. Other than the ramp says: the encoder.

        `setpoint` of the drive in the last scan [%], `scale` [mm/s per %], `limited`: at its torque limit, `enabled`: with supply,
        `jam_time` [s].
        """
        way = self.moved
        if not self.ramp.speed and not way and not self._model and not self._differs:
            return Finding.NONE
        if way:
            self._jam_age = 0.0
        if limited or not enabled or self.jammed:
            self._model, self._differs = way / DT, 0.0
            if limited and not way and abs(self.ramp.speed) >= DRIVEN:
                # not from zero after a stop: a gap stop in between must not hide a jam
                self._jam_age += DT
            if self._jam_age >= jam_time and not self.jammed:
                self.jammed = True
                return Finding.JAM
            return Finding.NONE
        self._model += (setpoint * scale - self._model) * FOLLOW
        if abs(self._model) < 1e-4:
            self._model = 0.0
        self._differs += self._model * DT - way - self._differs * DT / jam_time
        off = abs(self._differs)
        if off < 1e-4 and not self._model:
            self._differs = 0.0
        if off > IMPLAUSIBLE * abs(self._model) * jam_time + PULSES_OFF and not self.encoder_fault:
            self.encoder_fault = True
            return Finding.ENCODER
        return Finding.DEVIATION if off > UNCERTAIN_FROM else Finding.NONE

    def reset(self, scale: float) -> None:
        """Try again; `scale` [mm/s per %]."""
        self.jammed = self.encoder_fault = False
        self._jam_age = self._differs = 0.0
        self._model = self.ramp.speed * scale

    @property
    def motor(self) -> Motor:
        """Motor state."""
        if self.jammed:
            return Motor.JAMMED
        if self.encoder_fault:
            return Motor.ENCODER
        speed = self.ramp.speed
        if speed and not self.target:
            return Motor.STOPPING
        return Motor.FORWARD if speed > 0 else Motor.REVERSE if speed < 0 else Motor.STOPPED
