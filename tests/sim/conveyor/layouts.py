"""Lines of any build by seed, and the run of many products over one of them with what must hold in every scan."""

from dataclasses import dataclass, field, replace
from itertools import pairwise
from random import Random

from app.blocks.product_tracking import Code, TrackingEvent
from app.sim.conveyor.blades import GatePlan, Rule
from app.sim.conveyor.lanes import MOST_MERGES, MergePlan, Mode
from app.sim.conveyor.machine import MOST_BELTS, MOST_SENSORS, Geometry
from app.sim.conveyor.program import VirtualConveyor
from tests.sim.conveyor.bench import QUICK

LONGEST, SHORTEST = 60.0, 20.0
WAY = 600.0
"""Longest way between two sensors [mm]."""
NEAR = 5.0
"""So far may a record be from its product [mm]: the sensor tolerance of the settings."""


def layout(seed: int, *, belts: int = 0, sensors: int = 0) -> Geometry:
    """A line that can be built: each belt longer than two products, sensors at rising places, the last one on the last belt.

    As many belts and sensors as asked for, 0 = as chance has it.
    """
    chance = Random(seed)
    count = belts or chance.randint(1, MOST_BELTS)
    ends: list[float] = []
    for _ in range(count):
        ends.append(round((ends[-1] if ends else 0.0) + chance.uniform(180, 420), 1))
    first = round(chance.uniform(70, 100), 1)
    last = round(chance.uniform((ends[-2] if count > 1 else first) + 60, ends[-1] - 20), 1)
    # no way without a sensor is so long that slip alone takes a product out of the tolerance
    least, most = 2 + int((last - first) / WAY), min(MOST_SENSORS, 1 + int((last - first) / 20))
    number = sensors or chance.randint(min(least, most), most)
    places = [last]
    if number > 1:
        step = (last - first) / (number - 1)
        inner = (first + step * (n + chance.uniform(-0.2, 0.2)) for n in range(1, number - 1))
        places = [first, *(round(place, 1) for place in inner), last]
    shares = tuple(float(chance.randint(80, 100)) for _ in range(count))
    return Geometry(
        tuple(ends),
        tuple(places),
        roller_radius=chance.choice((12.0, 15.0, 25.0)),
        rated_speed=60.0,
        resolution=chance.choice((1024, 1650, 4096)),
        intact_is_one=chance.random() < 0.5,
        # what comes faster than it goes on would only wait
        shares=tuple(sorted(shares)),
    )


def layout_with_gates(seed: int) -> Geometry:
    """Any line, with one to eight gates at any places where they may be."""
    chance = Random(seed)
    line = layout(seed, belts=chance.randint(2, 9))
    scanner = line.sensors[0]
    places: list[float] = []
    goal = chance.randint(1, 8)
    for _ in range(400):
        if len(places) == goal:
            break
        x = round(chance.uniform(scanner + 40, line.sensors[-1] - 25), 1)
        if all(abs(x - y) >= 20 for y in places) and all(abs(x - y) >= 10 for y in line.sensors):
            places.append(x)
    rules = [Rule.CLASS, Rule.HEAVIER, Rule.ALTERNATING, Rule.HAND]
    plans = []
    for x in sorted(places):
        rule = chance.choice(rules) if plans else Rule.ALTERNATING
        plans.append(GatePlan(x, rule, {Rule.CLASS: 1.0 + chance.randrange(3), Rule.HEAVIER: 2.1}.get(rule, 0.0)))
    return replace(line, gates=tuple(plans))


def layout_with_lanes(seed: int) -> Geometry:
    """Any line with gates, and one to four lanes that join it where they may."""
    chance = Random(f"{seed} lanes")
    line = layout_with_gates(seed)
    places: list[float] = []
    goal = chance.randint(1, MOST_MERGES)
    for _ in range(400):
        if len(places) == goal:
            break
        x = round(chance.uniform(line.sensors[0] + 110, line.sensors[-1] - 25), 1)
        near = (*places, *line.sensors)
        if any(abs(x - y) < 20 for y in near) or any(-20 < gate.at - x < 100 for gate in line.gates):
            continue
        places.append(x)
    plans = []
    for x in sorted(places):
        before = max((end for end in line.belt_ends if end < x), default=0.0)
        mode = chance.choice(list(Mode)) if before and x - before >= 100 else Mode.LINE
        plans.append(MergePlan(x, mode, round(chance.uniform(10, 25), 1)))
    return replace(line, merges=tuple(plans))


def options(geometry: Geometry, **more: object) -> str:
    """What a plant file says of such a line, and `more`."""
    said: dict[str, object] = {
        "belts": geometry.belts,
        "line_length": geometry.length,
        "sensors": len(geometry.sensors),
        "gates": len(geometry.gates),
        "roller_radius": geometry.roller_radius,
        "rated_speed": geometry.rated_speed,
        "resolution": geometry.resolution,
        "intact_is_one": int(geometry.intact_is_one),
    }
    said |= {f"belt_{n}_end": end for n, end in enumerate(geometry.belt_ends[:-1], 1)}
    said |= {f"sensor_{n}": place for n, place in enumerate(geometry.sensors, 1)}
    said |= {f"belt_{n}_share": round(share) for n, share in enumerate(geometry.speed_shares, 1)}
    for n, gate in enumerate(geometry.gates, 1):
        said |= {f"gate_{n}_at": gate.at, f"gate_{n}_rule": int(gate.rule), f"gate_{n}_value": gate.value}
    said["merges"] = len(geometry.merges)
    for n, merge in enumerate(geometry.merges, 1):
        said |= {f"merge_{n}_at": merge.at, f"merge_{n}_mode": int(merge.mode), f"merge_{n}_gap": merge.gap}
    return "".join(f"{key} = {value}\n" for key, value in (said | more).items())


@dataclass(slots=True)
class Run:
    """What became of the products of one run."""

    plc: VirtualConveyor
    told: list[TrackingEvent] = field(default_factory=list)
    scans: int = 0

    def codes(self, code: Code) -> list[TrackingEvent]:
        return [event for event in self.told if event.code == code]


def run(geometry: Geometry, seed: int, products: int, *, interval: float = 4.0) -> Run:
    """Let so many products be unloaded in automatic.

    Raises:
        AssertionError: a product was lost or doubled, has overtaken, is not where its record is, or the line stands for ever.
    """
    plc = VirtualConveyor(
        geometry,
        seed=seed,
        start="automatic",
        interval=interval,
        shortest=SHORTEST,
        longest=LONGEST,
        slots=60,
        settings={**QUICK, "longest": 80.0},
    )
    done = Run(plc)
    report = plc.report

    def heard(event: TrackingEvent) -> None:
        done.told.append(event)
        report(event)

    plc.report = heard  # type: ignore[method-assign]
    taken, limit = 0, 0
    while plc.machine.unloaded < products:
        plc.step()
        done.scans += 1
        limit = 0 if plc.machine.unloaded != taken else limit + 1
        taken = plc.machine.unloaded
        assert limit < 60_000, (
            f"no product in ten minutes after {taken}: state {plc.state}, first out {plc.first_out.first}"
        )
        if done.scans % 10 == 0:
            check(plc)
    return done


def check(plc: VirtualConveyor) -> None:
    """Now: every product behind the first sensor has one record, in the same order, at the same place."""
    follow, machine = plc.tracking, plc.machine
    records = sorted(follow.products, key=lambda product: -product.right)
    assert [product.id for product in records] == sorted(product.id for product in records), "nobody overtakes"
    first = plc.geometry.sensors[0]
    true = [product for product in machine.products if product.head > first + NEAR]
    known = [product for product in records if product.right > first + NEAR]
    if len(true) != len(known):  # one that is just being taken, or stands at the border
        assert abs(len(true) - len(known)) <= 1, f"{len(true)} products, {len(known)} records"
        return
    for product, record in zip(true, known, strict=True):
        assert abs(product.head - record.right) < NEAR, (
            f"product {record.id}: {product.head:.1f}, {record.right:.1f} mm"
        )
    for front, rear in pairwise(records):
        assert rear.right <= front.left + 1e-6, "records do not overlap"
