"""What the conveyor's PLC shows: status and configuration image, and the rows of the product table, packed as the map says."""

from collections.abc import Iterator, Sequence
from math import nan

from app.blocks.ramp_record import PHASES
from app.sim.conveyor.belt import Belt
from app.sim.conveyor.blades import MOST_GATES
from app.sim.conveyor.lanes import MOST_MERGES
from app.sim.conveyor.machine import FEW_BELTS, FEW_SENSORS, MOST_BELTS, MOST_SENSORS
from app.sim.conveyor.register_map import (
    CONFIGURATION_IMAGE,
    GATE_PLANS,
    GATE_PLANS_IMAGE,
    GATES,
    GATES_IMAGE,
    MERGE_PLANS,
    MERGE_PLANS_IMAGE,
    MERGES,
    MERGES_IMAGE,
    MORE_BELTS,
    MORE_BELTS_IMAGE,
    MORE_CONFIGURATION,
    MORE_CONFIGURATION_IMAGE,
    MORE_FIRST,
    MORE_STATUS,
    MORE_STATUS_IMAGE,
    ORIGIN_IMAGE,
    RAMP_IMAGE,
    READING_IMAGE,
    ROW_IMAGE,
    SHARES,
    SHARES_IMAGE,
    STATUS_IMAGE,
    is_wide,
)
from app.sim.conveyor.scanner import ReadingState
from app.sim.conveyor.state import LineState
from app.sim.plc import Image

_FEW = 0b1111
"""Sensors and areas that the first status image has bits for."""


def more(plc: LineState) -> Iterator[Image]:
    """The images of what not every line has."""
    measures = plc.geometry
    if is_wide(measures.belts, len(measures.sensors)):
        yield Image(MORE_STATUS, 110, lambda: more_status(plc))
        yield Image(MORE_CONFIGURATION, 112, lambda: more_configuration(plc))
        yield Image(SHARES, 34, lambda: shares(plc))
        if measures.belts > MORE_FIRST:
            yield Image(MORE_BELTS, 64, lambda: more_belts(plc))
    if measures.gates:
        yield Image(GATES, 68, lambda: gates(plc))
        yield Image(GATE_PLANS, 68, lambda: gate_plans(plc))
    if measures.merges:
        yield Image(MERGES, 36, lambda: merges(plc))
        yield Image(MERGE_PLANS, 36, lambda: merge_plans(plc))


def status(plc: LineState) -> bytes:
    """The status image."""
    follow, machine, first = plc.tracking, plc.machine, plc.first_out.first
    gap = follow.gap
    few = plc.belts[:FEW_BELTS]
    belts = [number for belt in few for number in (*_belt(plc, belt), 0, 0)]
    belts += [0] * 9 * (FEW_BELTS - len(few))
    return STATUS_IMAGE.pack(
        plc.state,
        plc.modes.mode,
        _facts(plc),
        _alarms(plc),
        machine.beams & _FEW,
        machine.raw_inputs & _FEW,
        follow.areas & _FEW,
        len(follow.products),
        0,
        follow.next_id,
        gap.gap if gap else nan,
        gap.limit if gap else nan,
        gap.rear if gap else 0,
        gap.front if gap else 0,
        first.code,
        first.source,
        first.rear,
        first.front,
        first.time,
        first.value,
        follow.entered,
        follow.unloaded,
        follow.lost,
        follow.unexpected,
        follow.corrections,
        plc.belts[0].speed(plc.geometry.pulse_length, plc.steps),
        follow.greatest_correction,
        0,
        *belts,
        0,
        0,
        0,
        0,
        0,
    )


def configuration(plc: LineState) -> bytes:
    """The configuration image."""
    measures = plc.geometry
    return CONFIGURATION_IMAGE.pack(
        measures.belts,
        len(measures.sensors),
        len(plc.line.area_ends),
        *_filled(measures.belt_ends, 0, FEW_BELTS),
        *_filled(measures.sensors, 0, FEW_SENSORS),
        *_filled(measures.area_ends, 0, FEW_BELTS + 1),
        measures.length,
        measures.roller_radius,
        measures.rated_speed,
        measures.resolution,
        measures.intact_is_one,
        plc.line.slots,
        measures.pulse_length,
        plc.scanner.sensor,
        len(measures.gates),
        len(measures.merges),
    )


def more_status(plc: LineState) -> bytes:
    """The status image of a wide line: faults, beams, inputs and areas of all, belts 4–11."""
    machine, faults = plc.machine, plc.tracking.sensor_faults
    belts = plc.belts[FEW_BELTS:MORE_FIRST]
    return MORE_STATUS_IMAGE.pack(
        _bits(*(belt.jammed for belt in plc.belts)),
        _bits(*(belt.encoder_fault for belt in plc.belts)),
        *(word for bits in (faults, machine.beams, machine.raw_inputs, plc.tracking.areas) for word in _words(bits)),
        0,
        *(number for belt in belts for number in _belt(plc, belt)),
        *(0,) * 7 * (MORE_FIRST - FEW_BELTS - len(belts)),
        0,
    )


def more_belts(plc: LineState) -> bytes:
    """The status image of belts 12–16."""
    belts = plc.belts[MORE_FIRST:]
    told = [number for belt in belts for number in _belt(plc, belt)]
    return MORE_BELTS_IMAGE.pack(0, *told, *(0,) * 7 * (MOST_BELTS - MORE_FIRST - len(belts)), 0)


def more_configuration(plc: LineState) -> bytes:
    """The configuration image of a wide line: belts from 4, sensors and areas from 5."""
    measures = plc.geometry
    return MORE_CONFIGURATION_IMAGE.pack(
        0,
        *_filled(measures.belt_ends, FEW_BELTS, MOST_BELTS),
        *_filled(measures.sensors, FEW_SENSORS, MOST_SENSORS),
        *_filled(measures.area_ends, FEW_BELTS + 1, MOST_BELTS + 1),
        0,
    )


def shares(plc: LineState) -> bytes:
    """What each belt of a wide line goes in automatic."""
    told = [round(share) for share in plc.geometry.speed_shares]
    return SHARES_IMAGE.pack(*told, *(0,) * (MOST_BELTS - len(told)))


def gates(plc: LineState) -> bytes:
    """How the diverting gates stand."""
    told = [
        number
        for gate, diverted in zip(plc.gates.all, plc.tracking.diverted, strict=True)
        for number in (gate.position, gate.lane, gate.fault, gate.held, diverted, gate.misrouted)
    ]
    return GATES_IMAGE.pack(0, *told, *(0,) * (6 * MOST_GATES - len(told)), 0)


def gate_plans(plc: LineState) -> bytes:
    """How the diverting gates are built."""
    told = [number for gate in plc.geometry.gates for number in (gate.at, gate.rule, gate.value, gate.time)]
    none = (nan, 0, nan, nan) * (MOST_GATES - len(plc.geometry.gates))
    return GATE_PLANS_IMAGE.pack(0, *told, *none, 0)


def merges(plc: LineState) -> bytes:
    """How the merging gates stand."""
    told = [
        number
        for merge, merged in zip(plc.merges.all, plc.tracking.merged, strict=True)
        for number in (merge.state, merge.order, merge.length > 0, merge.holds >= 0, merged, merge.waited)
    ]
    return MERGES_IMAGE.pack(0, *told, *(0,) * (6 * MOST_MERGES - len(told)), 0)


def merge_plans(plc: LineState) -> bytes:
    """How the merging gates are built."""
    told = [number for plan in plc.geometry.merges for number in (plan.at, plan.mode, plan.gap, plan.limit)]
    none = (nan, 0, nan, nan) * (MOST_MERGES - len(plc.geometry.merges))
    return MERGE_PLANS_IMAGE.pack(0, *told, *none, 0)


def origin(plc: LineState, slot: int) -> bytes:
    """The row of a slot of the table of origins."""
    product, mark = plc.tracking.slots[slot], plc.generation
    return ORIGIN_IMAGE.pack(product.id if product else 0, mark, product.origin if product else 0, mark)


def row(plc: LineState, slot: int) -> bytes:
    """The row of a slot of the product table."""
    product = plc.tracking.slots[slot]
    mark = plc.generation
    if product is None:
        return ROW_IMAGE.pack(0, mark, 0, nan, nan, nan, 0, 0, nan, 0, nan, 0, 0, mark)
    return ROW_IMAGE.pack(
        product.id,
        mark,
        product.state,
        product.head,
        product.tail,
        product.whole,
        product.area,
        product.corrected_at,
        product.correction,
        min(max(0, plc.time - product.entered_us) // 1000, 0xFFFFFFFF),
        product.displacement,
        product.swapped,
        product.entered_us,
        mark,
    )


def reading(plc: LineState, slot: int) -> bytes:
    """The row of a slot of the table of readings."""
    product, mark = plc.tracking.slots[slot], plc.generation
    if product is None:
        return READING_IMAGE.pack(0, mark, 0, 0, 0, nan, 0, mark)
    state, label, time = plc.scanner.of(product.id)
    weight = label.weight if state == ReadingState.READ else nan
    return READING_IMAGE.pack(product.id, mark, state, label.order, label.category, weight, time, mark)


def ramp(plc: LineState, slot: int) -> bytes:
    """The row of a slot (from 0) of the table of ramps."""
    belt, is_stop = divmod(slot, 2)
    recorder, mark = plc.belts[belt].record if belt < len(plc.belts) else None, plc.generation
    record = None if recorder is None else recorder.stop if is_stop else recorder.start
    if record is None:
        return RAMP_IMAGE.pack(0, mark, 0, 0, *(nan,) * 8, mark)
    phases = [number for phase in record.phases for number in phase] + [0.0] * 2 * (PHASES - len(record.phases))
    return RAMP_IMAGE.pack(slot + 1, mark, record.state, record.began, record.speed, record.acceleration, *phases, mark)


def _facts(plc: LineState) -> int:
    return _bits(
        plc.modes.running,
        plc.moving,
        plc.stop_active,
        plc.pressed,
        plc.tracking.gap_stop,
        plc.tracking.brake,
        plc.host_silent,
        plc.tracking.uncertain,
        plc.tracking.buffer_full,
        any(belt.ramp.speed < 0 for belt in plc.belts),
        plc.machine.pressed != 0,
    )


def _alarms(plc: LineState) -> int:
    faults = plc.tracking.sensor_faults
    few, none = plc.belts[:FEW_BELTS], (False,) * (FEW_BELTS - len(plc.belts))
    return _bits(
        *(belt.jammed for belt in few),
        *none,
        *(belt.encoder_fault for belt in few),
        *none,
        plc.tracking.outside_present,
        plc.tracking.lost_present,
        plc.tracking.buffer_full,
        *(faults >> sensor & 1 for sensor in range(FEW_SENSORS)),
    )


def _belt(plc: LineState, belt: Belt) -> tuple[float, ...]:
    speed, scale = belt.speed(plc.geometry.pulse_length, plc.steps), plc.scale
    distance = abs(belt.stop_distance()) * scale
    return belt.target, speed / scale, distance, belt.pulses, speed, belt.motor, belt.source


def _filled(ends: Sequence[float], first: int, behind: int) -> tuple[float, ...]:
    """`ends` from index `first` to `behind`, NaN for what the line has not."""
    found = tuple(ends[first:behind])
    return (*found, *(nan,) * (behind - first - len(found)))


def _words(bits: int) -> tuple[int, int]:
    """First and second word of so many bits."""
    return bits & 0xFFFF, bits >> 16


def _bits(*flags: bool | int) -> int:
    return sum(1 << bit for bit, flag in enumerate(flags) if flag)
