"""What the conveyor's PLC shows: status and configuration image, and the rows of the product table, packed as the map says."""

from math import nan

from app.blocks.ramp_record import PHASES
from app.sim.conveyor import training as own
from app.sim.conveyor.machine import BELTS, SENSORS
from app.sim.conveyor.register_map import CONFIGURATION_IMAGE, RAMP_IMAGE, ROW_IMAGE, STATUS_IMAGE
from app.sim.conveyor.state import LineState


def status(plc: LineState) -> bytes:
    """The status image."""
    follow, machine, first = plc.tracking, plc.machine, plc.first_out.first
    gap = follow.gap
    length, scale = plc.geometry.pulse_length, plc.geometry.full_speed / 100
    speeds = [belt.speed(length, plc.steps) for belt in plc.belts]
    belts = [
        number
        for belt, speed in zip(plc.belts, speeds, strict=True)
        for number in (
            belt.target,
            speed / scale,
            abs(belt.stop_distance()) * scale,
            belt.pulses,
            speed,
            belt.motor,
            belt.source,
            0,
            0,
        )
    ]
    return STATUS_IMAGE.pack(
        plc.state,
        plc.modes.mode,
        _facts(plc),
        _alarms(plc),
        machine.beams,
        machine.raw_inputs,
        follow.areas,
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
        speeds[0],
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
        BELTS,
        SENSORS,
        len(plc.line.area_ends),
        *measures.belt_ends,
        *measures.sensors,
        *measures.area_ends,
        measures.length,
        measures.roller_radius,
        measures.rated_speed,
        measures.resolution,
        measures.intact_is_one,
        plc.line.slots,
        measures.pulse_length,
    )


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
        product.length,
        product.area,
        product.corrected_at,
        product.correction,
        min(max(0, plc.time - product.entered_us) // 1000, 0xFFFFFFFF),
        product.displacement,
        product.swapped,
        product.entered_us,
        mark,
    )


def ramp(plc: LineState, slot: int) -> bytes:
    """The row of a slot (from 0) of the table of ramps."""
    belt, is_stop = divmod(slot, 2)
    recorder, mark = plc.belts[belt].record, plc.generation
    record = recorder.stop if is_stop else recorder.start
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
        plc.training[own.REG_SENSORS] != 0,
    )


def _alarms(plc: LineState) -> int:
    faults = plc.tracking.sensor_faults
    return _bits(
        *(belt.jammed for belt in plc.belts),
        *(belt.encoder_fault for belt in plc.belts),
        plc.tracking.outside_present,
        plc.tracking.lost_present,
        plc.tracking.buffer_full,
        *(faults >> sensor & 1 for sensor in range(SENSORS)),
    )


def _bits(*flags: bool | int) -> int:
    return sum(1 << bit for bit, flag in enumerate(flags) if flag)
