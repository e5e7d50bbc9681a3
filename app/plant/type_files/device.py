"""device.toml: what the device bears (telegrams, times), and what a sequence may ask of a machine of this type."""

import re
from collections.abc import Container, Iterator, Sequence

from app.plant.definitions import Device, Scan
from app.plant.picture import PictureData
from app.plant.said import said
from app.plant.tables import Table, is_number, one_of
from app.plant.type_files.names import KEY, NAME_EXPECTED
from app.plant.type_files.options import read_span
from app.registers.pdu import MAX_READ_BITS

SHORTEST = 0.01
"""Time for an answer [s]: within none nobody answers."""


def read_device(table: Table) -> Device:
    """`[device]`: how much one telegram carries, which functions it knows, how long it takes [s]."""
    groups, scans = table.table("group_read"), [scan.value for scan in Scan]
    device = Device(
        max_read=table.whole("max_read", 125, 1, 125),
        max_read_bits=table.whole("max_read_bits", MAX_READ_BITS, 1, MAX_READ_BITS),
        fallback_read=table.whole("fallback_read", 0, 0, 125),
        group_read={key: groups.whole(key, low=1, high=125) for key in scans if groups.has(key)},
        max_write=table.whole("max_write", 1, 1, 123),
        read_functions=tuple(_functions(table, "read_functions", (1, 2, 3, 4), (3,))),
        write_functions=tuple(_functions(table, "write_functions", (5, 6, 15, 16, 22), (6,))),
        turnaround=float(table.number("turnaround", 0.02, 0, 10)),
        timeout=float(table.number("timeout", 0.25, SHORTEST, 60)),
        connections=table.whole("connections", 1, 1, 64),
        pipelining=table.whole("pipelining", 1, 1, 64),
        keeps=table.flag("keeps", True),
        fast=float(table.number("fast", 0.1, 0.01, 3600)),
        slow=float(table.number("slow", 1.0, 0.01, 3600)),
        holes=tuple(_ranges(table, "holes")),
        write_only=tuple(_ranges(table, "write_only")),
        training=table.whole("training", 0xE000),
        makers_map=table.flag("makers_map", False),
    )
    check_periods(table)
    for key in groups.data.keys() - scans:
        groups.note(key, groups.data[key], said("mistake.no_such_key", known=one_of(scans, key)))
    table.done()
    return device


def check_periods(table: Table) -> None:
    """Note a `fast` that is slower than the `slow` beside it."""
    fast, slow = (table.data.get(key) for key in ("fast", "slow"))
    if is_number(fast) and is_number(slow) and fast > slow:
        table.note("fast", fast, said("mistake.fast_slow", slow=f"{slow:g}"))


def read_actions(head: Table, *, sequence: bool) -> tuple[str, ...]:
    """`[actions]`: what the steps of a sequence may ask of this machine."""
    table = head.table("actions")
    table.raw("orders")
    actions: list[str] = []
    for index, name in enumerate(table.items("names", [])):
        if not isinstance(name, str) or not re.fullmatch(KEY, name):
            table.note(f"names.{index}", name, NAME_EXPECTED)
        elif name in actions:
            table.note(f"names.{index}", name, said("mistake.action_once"))
        else:
            actions.append(name)
    table.done()
    if sequence and table.has("names"):
        head.note("actions", said("mistake.given"), said("mistake.no_actions"))
    return tuple(actions)


def read_simulation_presets(head: Table) -> dict[str, tuple[float, float]]:
    """`[presets_of_simulation]`: what a test of a sequence may set on the simulated machine, least and greatest."""
    table = head.table("presets_of_simulation")
    for name in table.data:
        if not re.fullmatch(KEY, name):
            table.note(name, name, NAME_EXPECTED)
    return {name: read_span(name, table) for name in table.data}


def read_tile(head: Table, names: Sequence[object], points: Container[str]) -> frozenset[str]:
    """`tile`: points that the tile on the overview draws, by key; the cells of tables are on the page of their machine only."""
    for index, name in enumerate(names):
        if not isinstance(name, str) or name not in points:
            head.note(f"tile.{index}", name, said("mistake.point_key"))
    return frozenset(str(name) for name in names)


def read_picture(table: Table, tile: Sequence[object]) -> PictureData:
    """`picture`: what the picture of the plant shows; each point is one of `tile`, so that the overview is told of it."""
    names = [str(name) for name in tile]
    expected = said("mistake.point_of_tile")
    points = {key: table.text(key, choices=names, expected=expected) for key in ("state", "moving", "figure")}
    when = table.text("when", "1", pattern=r"\d+(,\d+)*", expected=said("mistake.moving"))
    table.done()
    return PictureData(when=when, **points)


def _functions(table: Table, key: str, known: Sequence[int], usual: Sequence[int]) -> Iterator[int]:
    for index, item in enumerate(table.items(key, usual)):
        if isinstance(item, int) and not isinstance(item, bool) and item in known:
            yield item
        else:
            table.note(f"{key}.{index}", item, one_of([str(one) for one in known]))
            yield from known  # what was meant is not known, so that no register is blamed


def _ranges(table: Table, key: str) -> Iterator[tuple[int, int]]:
    for index, item in enumerate(table.items(key, [])):
        match item:
            case [int() as first, int() as last] if 0 <= first <= last <= 0xFFFF:
                yield first, last
            case _:
                table.note(
                    f"{key}.{index}",
                    item,
                    said("mistake.pair", pair="[first, last]", order="0 <= first <= last <= 65535"),
                )
