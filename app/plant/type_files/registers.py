"""The register of a point, and no two points on the same words of a type."""

from collections.abc import Iterable, Mapping, Sequence

from app.plant.definitions import Order, Register, Type
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


def read_register(table: Table, *, writable: bool, address: int | None = None) -> Register:
    """The register that `table` describes; with `address`, of a cell, whose place its table knows."""
    kind = Type(table.text("type", "u16", choices=[kind.value for kind in Type]))
    length = table.whole("words", WORDS[kind], 1, 125)
    if kind is not Type.STRING and length != WORDS[kind]:
        table.note("words", length, said("mistake.for_type", what=WORDS[kind], type=kind))
    mask, none = table.raw("mask"), table.raw("none")
    scale = float(table.number("scale", 1.0))
    if scale == 0:
        table.note("scale", 0, said("mistake.not_zero"))
    return Register(
        address=table.whole("address", low=0, high=0xFFFF) if address is None else address,
        type=kind,
        order=Order(table.text("order", "abcd", choices=[order.value for order in Order])),
        table=table.text("table", "holding", choices=("holding", "input")),
        mask=None if mask is None else table.whole("mask", low=1, high=0xFFFF_FFFF),
        shift=table.whole("shift", 0, 0, 63),
        scale=scale or 1.0,
        offset=float(table.number("offset", 0.0)) if address is None else 0.0,
        words=length,
        writable=table.flag("writable", writable),
        readable=table.flag("readable", True),
        none=None if none is None else table.whole("none", low=0, high=0xFFFF_FFFF),
    )


def check_registers(points: Iterable[PointData], sources: Sequence[Source]) -> None:
    """Two points may share words only when they split the same words into parts, or one says that it is a part of the other; noted in the
    file of the second."""
    taken: dict[tuple[str, int], PointData] = {}
    for data in points:
        register = None if data.part else data.point.register
        for address in range(register.address, register.address + register.words) if register else ():
            other = taken.setdefault((register.table if register else "", address), data)
            if other is not data and register and not _splits(other.point.register, register):
                file = next((source for source in sources if data.point.key in source.data), sources[0]).table()
                expected = said("mistake.words_free", other=other.point.key)
                file.note(f"{data.point.key}.address", f"0x{register.address:04X}", expected)
                break


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
