"""A true line for tests: belts that follow their ramps, products on them, beams and encoders; it knows where everything really is."""

from dataclasses import dataclass, field

from app.blocks.encoder import Encoder
from app.blocks.product_tracking import Code, LineLayout, ProductTracking, Settings, TrackingEvent, share
from app.blocks.s_ramp import SRamp


@dataclass
class Thing:
    """A real product."""

    right: float
    length: float
    moved: float = 0.0

    @property
    def left(self) -> float:
        return self.right - self.length


@dataclass
class BeltLine:
    """The machine under a tracker, scanned every `dt` [s]; `slip` is how much less than the belt a product on it moves."""

    tracking: ProductTracking = field(default_factory=lambda: ProductTracking(LineLayout()))
    dt: float = 0.01
    slip: float = 0.0
    blind: set[int] = field(default_factory=set)
    stuck: set[int] = field(default_factory=set)
    things: list[Thing] = field(default_factory=list)
    time_us: int = 0
    events: list[TrackingEvent] = field(default_factory=list)

    def __post_init__(self) -> None:
        belts = len(self.tracking.line.belt_ends)
        self.ramps = [SRamp(60.0, 240.0) for _ in range(belts)]
        self.encoders = [Encoder(1650, 40, 15) for _ in range(belts)]

    def put(self, right: float, length: float) -> Thing:
        """A product on the line by hand, without telling."""
        thing = Thing(right, length)
        self.things.append(thing)
        self.things.sort(key=lambda other: other.right, reverse=True)
        return thing

    def beams(self) -> list[bool]:
        return [
            n in self.stuck or (n not in self.blind and any(thing.left < x < thing.right for thing in self.things))
            for n, x in enumerate(self.tracking.line.sensors)
        ]

    def run(self, speed: float, seconds: float, *, obey: bool = True) -> list[TrackingEvent]:
        """Runs all belts towards `speed` [%]; obeys brake and gap stop as a machine does. Gives the new events."""
        start = len(self.events)
        for _ in range(round(seconds / self.dt)):
            self.step([speed] * len(self.ramps), obey=obey)
        return self.events[start:]

    def step(self, speeds: list[float], *, obey: bool = True) -> list[TrackingEvent]:
        tracking = self.tracking
        targets = list(speeds)
        if obey and tracking.brake and targets[-1] > 0:
            targets[-1] = 0.0
        if obey and tracking.gap_stop:
            targets = [0.0] * len(targets)
        moved, true, stops = [], [], []
        for ramp, encoder, target in zip(self.ramps, self.encoders, targets, strict=True):
            before = ramp.speed
            out = ramp.step(target, self.dt)
            mean = (before + out.speed) / 2
            moved.append(encoder.distance(encoder.step(mean, self.dt)))
            true.append(mean / 100 * encoder.full_speed * self.dt)
            stops.append(out.stop_distance / 100 * encoder.full_speed)
        ends = tracking.line.belt_ends
        for thing in self.things:
            delta = share(thing.left, thing.right, ends, true) * (1 - self.slip)
            thing.right += delta
            thing.moved += delta
        self.time_us += round(self.dt * 1e6)
        events = tracking.scan(moved, self.beams(), stops, self.time_us)
        for event in events:
            if event.code is Code.UNLOADED and self.things and self.things[0].right > ends[-1] - 20:
                self.things.pop(0)
        self.things = [thing for thing in self.things if thing.left < ends[-1] and thing.right > -500]
        self.events += events
        return events


def codes(events: list[TrackingEvent]) -> list[Code]:
    return [event.code for event in events]


def line_with(**settings: float) -> BeltLine:
    return BeltLine(ProductTracking(LineLayout(), Settings(**settings)))
