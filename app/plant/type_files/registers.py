"""The register of a point, and no two points on the same words of a type."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

from app.plant.definitions import Device, Order, Register, Type
from app.plant.said import said
from app.plant.tables import Source, Table
from app.plant.type_files.data import PointData

WORDS: Mapping[Type, int] = {
    Type.U16: 1,
    Type.I16: 1,
    Type.U32: 2,
    Type.I32: 2,
    Type.F32: 2,
    Type.U64: 4,
    Type.STRING: 16,
}

UNKNOWN = ("i64", "s64", "int64", "f64", "double", "real64", "lreal", "float64")
"""Types of other tools that no register here has."""
PARTS, SCALES = ("mask", "shift", "none"), ("scale", "offset")
READ = {"holding": 3, "input": 4}
"""Table → the function that reads it."""
WRITE_ONE, WRITE_SEVERAL = 6, 16
LAST_ADDRESS = 0xFFFF


def read_register(table: Table, *, writable: bool, address: int | None = None) -> Register:
    """The register that `table` describes; with `address`, of a cell, whose place its table knows."""
    kinds = [kind.value for kind in Type]
    known = said("mistake.no_64", known=", ".join(kinds)) if table.data.get("type") in UNKNOWN else ""
    kind = Type(table.text("type", "u16", choices=kinds, expected=known))
    length = table.whole("words", WORDS[kind], 1, 125)
    if kind is not Type.STRING and length != WORDS[kind]:
        table.note("words", length, said("mistake.for_type", what=WORDS[kind], type=kind))
    mask, none = table.raw("mask"), table.raw("none")
    shift = table.whole("shift", 0, 0, 63)
    scale = float(table.number("scale", 1.0))
    if scale == 0:
        table.note("scale", 0, said("mistake.not_zero"))
    register = Register(
        address=table.whole("address", low=0, high=0xFFFF) if address is None else address,
        type=kind,
        order=Order(table.text("order", "abcd", choices=[order.value for order in Order])),
        table=table.text(
            "table", "holding", choices=tuple(READ), expected=said("mistake.no_coils", known=", ".join(READ))
        ),
        mask=None if mask is None else table.whole("mask", low=1, high=0xFFFF_FFFF),
        shift=shift,
        scale=scale or 1.0,
        offset=float(table.number("offset", 0.0)) if address is None else 0.0,
        words=length,
        writable=table.flag("writable", writable),
        readable=table.flag("readable", True),
        none=None if none is None else table.whole("none", low=0, high=0xFFFF_FFFF),
    )
    _check_bits(table, register)
    return register


def _check_bits(table: Table, register: Register) -> None:
    """What would be read and make no difference: bits of what has none, and bits above the last one."""
    kind = register.type
    for key in PARTS if kind in (Type.F32, Type.STRING) else ():
        if table.has(key):
            table.note(key, table.raw(key), said("mistake.no_bits", type=kind, key=key))
    for key in SCALES if kind is Type.STRING else ():
        if table.has(key):
            table.note(key, table.raw(key), said("mistake.no_number", type=kind, key=key))
    if kind in (Type.F32, Type.STRING):
        return
    bits = 16 * WORDS[kind]
    if register.shift >= bits:
        table.note("shift", register.shift, said("mistake.bits_of", bits=bits, type=kind))
    elif register.mask is not None and (register.mask << register.shift) >> bits:
        table.note("mask", register.mask, said("mistake.bits_of", bits=bits, type=kind))
    if register.none is not None and register.none >> bits:
        table.note("none", register.none, said("mistake.bits_of", bits=bits, type=kind))


def check_registers(points: Iterable[PointData], sources: Sequence[Source]) -> None:
    """Two points may share words only when they split the same words into parts, or one says that it is a part of the other; noted in the
    file of the second."""
    taken: dict[tuple[str, int], PointData] = {}
    for data in points:
        register = None if data.part else data.point.register
        for address in range(register.address, register.address + register.words) if register else ():
            other = taken.setdefault((register.table if register else "", address), data)
            if other is not data and register and not _splits(other.point.register, register):
                expected = said("mistake.words_free", other=other.point.key)
                _file_of(data, sources).note(f"{data.point.key}.address", f"0x{register.address:04X}", expected)
                break


def check_telegrams(points: Iterable[PointData], device: Device, sources: Sequence[Source]) -> None:
    """What no telegram that `device` takes can read or write is noted where it stands: a link would never have its value, and a command
    that writes it would never arrive."""
    for data in points:
        register = data.point.register
        for key, value, expected in _unreached(register, device) if register and not data.part else ():
            _file_of(data, sources).note(f"{data.point.key}.{key}", value, expected)


def _unreached(register: Register, device: Device) -> Iterator[tuple[str, str, str]]:
    """Key, value and what was expected."""
    last = register.address + register.words - 1
    for name, ranges in (("holes", device.holes), ("write_only", device.write_only)) if register.readable else ():
        for first, end in ranges:
            if register.table == "holding" and register.address <= end and first <= last:
                expected = said("mistake.not_read_there", key=name, first=first, last=end)
                yield "address", f"0x{register.address:04X}", expected
    if register.readable and register.words > device.max_read:
        yield "type", register.type.value, said("mistake.needs_max_read", words=register.words)
    if last > LAST_ADDRESS:
        yield "address", f"0x{register.address:04X}", said("mistake.register_end")
    if register.readable and READ[register.table] not in device.read_functions:
        yield "table", register.table, _needed(READ[register.table], "read_functions", device.read_functions)
    if not register.writable:
        return
    function = WRITE_ONE if register.words == 1 and WRITE_ONE in device.write_functions else WRITE_SEVERAL
    if register.table != "holding":
        yield "table", register.table, said("mistake.as_is", what="holding")
    elif function not in device.write_functions:
        told = f"{WRITE_ONE}" if register.words == 1 else f"{WRITE_SEVERAL}"
        yield "writable", "true", _needed(told, "write_functions", device.write_functions)
    elif register.words > max(1, device.max_write):
        yield "type", register.type.value, said("mistake.needs_max_write", words=register.words)


def _needed(function: int | str, key: str, known: Sequence[object]) -> str:
    return said("mistake.needs_function", function=function, key=key, known=", ".join(map(str, known)) or "[]")


def _file_of(data: PointData, sources: Sequence[Source]) -> Table:
    return next((source for source in sources if data.point.key in source.data), sources[0]).table()


def _splits(one: Register | None, other: Register) -> bool:
    if one is None or (one.address, one.words, one.type, one.order) != (
        other.address,
        other.words,
        other.type,
        other.order,
    ):
        return False
    if one.mask is None or other.mask is None:
        return False
    return one.mask << one.shift & other.mask << other.shift == 0
