"""The register of a point, or its coil or discrete input, and no two points on the same words of a type.

`address` is the 0-based protocol address, or the number of a manual as a text ("40001", "10017"), which names its table, too.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

from app.plant import plc
from app.plant.definitions import Device, Order, PlcMap, Register, Scan, Type
from app.plant.said import said
from app.plant.tables import Source, Table
from app.plant.type_files.data import PointData
from app.registers.codec import own_bits
from app.registers.pdu import FUNCTIONS, MASK_WRITE, WRITE_COIL, WRITE_COILS
from app.registers.pdu import WRITE_MULTIPLE as WRITE_SEVERAL
from app.registers.pdu import WRITE_SINGLE as WRITE_ONE
from app.registers.references import place, reference
from app.registers.register import BIT_TABLES, REALS

WORDS: Mapping[Type, int] = {
    Type.U16: 1,
    Type.I16: 1,
    Type.U32: 2,
    Type.I32: 2,
    Type.F32: 2,
    Type.U64: 4,
    Type.I64: 4,
    Type.F64: 4,
    Type.STRING: 16,
    Type.BIT: 1,
}

PARTS, SCALES = ("mask", "shift", "none"), ("scale", "offset")
OF_REGISTERS = ("type", "order", "words", *PARTS, *SCALES)
"""What is said of registers, and of no single bit."""
WRITABLE = {"input": "holding", "discrete": "coil"}
"""Table that is only read → the like of it that is written."""
LAST_ADDRESS = 0xFFFF
LARGEST_RAW = 0xFFFF_FFFF_FFFF_FFFF


def read_register(table: Table, *, writable: bool, address: int | None = None) -> Register:
    """The register that `table` describes; with `address`, of a cell, whose place its table knows."""
    where, at = _place(table) if address is None else ("holding", address)
    tables = tuple(FUNCTIONS) if address is None else ("holding",)
    given = table.text("table", where or "holding", choices=tables)
    if where and given != where:
        table.note("table", given, said("mistake.reference_table", number=table.raw("address"), table=where))
        given = where
    if given in BIT_TABLES:
        return _bit(table, given, at, writable)
    kinds = [kind.value for kind in Type if kind is not Type.BIT]
    kind = Type(table.text("type", "u16", choices=kinds))
    length = table.whole("words", WORDS[kind], 1, 125)
    if kind is not Type.STRING and length != WORDS[kind]:
        table.note("words", length, said("mistake.for_type", what=WORDS[kind], type=kind))
    mask = table.raw("mask")
    shift = table.whole("shift", 0, 0, 63)
    scale = float(table.number("scale", 1.0))
    if scale == 0:
        table.note("scale", 0, said("mistake.not_zero"))
    register = Register(
        address=at,
        type=kind,
        order=Order(table.text("order", "abcd", choices=[order.value for order in Order])),
        table=given,
        mask=None if mask is None else table.whole("mask", low=1, high=LARGEST_RAW),
        shift=shift,
        scale=scale or 1.0,
        offset=float(table.number("offset", 0.0)) if address is None else 0.0,
        words=length,
        writable=table.flag("writable", writable),
        readable=table.flag("readable", True),
        none=_none(table),
    )
    _check_bits(table, register)
    if register.words == 1 and register.order is Order.CDAB:
        table.doubt("order", register.order.value, said("mistake.doubt_order"))
    return register


def _place(table: Table) -> tuple[str, int]:
    """Table and address that `address` says; the table is empty where a protocol address says nothing of it."""
    given = table.raw("address")
    if not isinstance(given, str):
        return "", table.whole("address", low=0, high=LAST_ADDRESS)
    found = place(given)
    if found is None:
        first = ", ".join(f'"{reference(0, name)}" ({name})' for name in FUNCTIONS)
        table.note("address", given, said("mistake.reference", last=LAST_ADDRESS, numbers=first))
    return found or ("", 0)


def _none(table: Table) -> int | None:
    """The raw value that means "no value"; one that TOML has no whole number for is a text, "0xFFFFFFFFFFFFFFFF"."""
    given = table.raw("none")
    if isinstance(given, str) and re.fullmatch("0x[0-9A-Fa-f]{1,16}", given):
        return int(given, 16)
    return None if given is None else int(table.whole("none", low=0, high=LARGEST_RAW))


def _bit(table: Table, name: str, address: int, writable: bool) -> Register:
    """A coil or a discrete input: one bit with an address of its own."""
    for key in OF_REGISTERS:
        if table.has(key):
            table.note(key, table.raw(key), said("mistake.single_bit", key=key, table=name))
    writable = table.flag("writable", writable)
    return Register(address, Type.BIT, table=name, writable=writable, readable=table.flag("readable", True))


def _check_bits(table: Table, register: Register) -> None:
    """What would be read and make no difference: bits of what has none, and bits above the last one."""
    kind = register.type
    for key in PARTS if kind in (*REALS, Type.STRING) else ():
        if table.has(key):
            table.note(key, table.raw(key), said("mistake.no_bits", type=kind, key=key))
    for key in SCALES if kind is Type.STRING else ():
        if table.has(key):
            table.note(key, table.raw(key), said("mistake.no_number", type=kind, key=key))
    if kind in (*REALS, Type.STRING):
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
                key = "bit_free" if register.type is Type.BIT else "words_free"
                expected = said(f"mistake.{key}", other=other.point.key)
                _file_of(data, sources).note(f"{data.point.key}.address", f"0x{register.address:04X}", expected)
                break


def check_generations(points: Iterable[PointData], map: PlcMap, sources: Sequence[Source]) -> None:
    """No point lies on a word of an image that is its generation, or the count of settings; noted in the file of the point."""
    images = [(image, False) for image in map.images] + ([(map.settings, True)] if map.settings else [])
    taken = {address for image, settings in images for address in plc.fixed_words(image, settings=settings)}
    for data in points:
        register = None if data.part else data.point.register
        if register is None or register.table != "holding":
            continue
        met = sorted(taken.intersection(range(register.address, register.address + register.words)))
        if met:
            words = ", ".join(f"0x{address:04X}" for address in met)
            expected = said("mistake.generation_free", words=words)
            _file_of(data, sources).note(f"{data.point.key}.address", f"0x{register.address:04X}", expected)


def check_telegrams(points: Iterable[PointData], device: Device, sources: Sequence[Source]) -> None:
    """What no telegram that `device` takes can read or write is noted where it stands: a link would never have its value, and a command
    that writes it would never arrive."""
    for data in points:
        register = data.point.register
        for key, value, expected in _unreached(register, device, data.point.scan) if register and not data.part else ():
            _file_of(data, sources).note(f"{data.point.key}.{key}", value, expected)


def _unreached(register: Register, device: Device, scan: Scan) -> Iterator[tuple[str, str, str]]:
    """Key, value and what was expected."""
    last = register.address + register.words - 1
    never = [("holes", device.holes)] if register.table not in BIT_TABLES else []
    never += [("write_only", device.write_only)] if register.table == "holding" else []
    for name, ranges in never if register.readable else ():
        for first, end in ranges:
            if register.address <= end and first <= last:
                expected = said("mistake.not_read_there", key=name, first=first, last=end)
                yield "address", f"0x{register.address:04X}", expected
    limits = {f"group_read.{scan.value}": device.group_read.get(scan.value), "max_read": device.max_read}
    for name, most in {**limits, "fallback_read": device.fallback_read or None}.items() if register.readable else ():
        if most is not None and register.words > most:
            yield "type", register.type.value, said("mistake.needs_max_read", key=name, words=register.words)
            break
    if last > LAST_ADDRESS:
        yield "address", f"0x{register.address:04X}", said("mistake.register_end")
    if register.readable and FUNCTIONS[register.table] not in device.read_functions:
        yield "table", register.table, _needed(FUNCTIONS[register.table], "read_functions", device.read_functions)
    if not register.writable:
        return
    single = [WRITE_ONE, *([MASK_WRITE] if own_bits(register) is not None else [])] if register.words == 1 else []
    function = next((one for one in single if one in device.write_functions), WRITE_SEVERAL)
    if register.table in WRITABLE:
        yield "table", register.table, said("mistake.as_is", what=WRITABLE[register.table])
    elif register.type is Type.BIT:
        if WRITE_COIL not in device.write_functions and WRITE_COILS not in device.write_functions:
            yield "writable", "true", _needed(WRITE_COIL, "write_functions", device.write_functions)
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
