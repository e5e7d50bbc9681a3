"""tables.toml: the tables of a Pogon PLC, their columns, and the points in their heads."""

import re
from dataclasses import replace

from app.plant import plc
from app.plant.definitions import TableMap
from app.plant.said import said
from app.plant.tables import Table
from app.plant.type_files.data import PointData
from app.plant.type_files.interventions import read_interventions
from app.plant.type_files.names import KEY, KEY_EXPECTED
from app.plant.type_files.options import Options
from app.plant.type_files.points import Points


def read_tables(
    file: Table, options: Options, points: Points, *, has_map: bool
) -> tuple[dict[str, TableMap], dict[str, dict[str, PointData]]]:
    """Each table, and its columns as the cells of slot 1; `points` get those in their heads."""
    tables: dict[str, TableMap] = {}
    columns: dict[str, dict[str, PointData]] = {}
    if file.data and not has_map:
        file.note("", ", ".join(file.data), said("mistake.plc_tables", table="[plc]", file="device.toml"))
    for key, table in file.tables():
        if not re.fullmatch(KEY, key):
            table.note("", key, KEY_EXPECTED)
        mistakes = len(table.source.problems)
        map = plc.read_table(key, table, options.values, options.ranges)
        columns[key] = {}
        for name, column in table.tables("columns"):
            columns[key][name] = points.cell(name, column, map)
        registers = {name: data.point.register for name, data in columns[key].items()}
        if len(table.source.problems) == mistakes:
            plc.check_columns(table, map, {name: register for name, register in registers.items() if register})
        for name, word in plc.HEAD_POINTS.items():
            points.add_head(table, f"{key}_{name}", f"table.{name}", map.address + word)
        tables[key] = replace(map, interventions=read_interventions(table, map))
        table.done()
    for key in points.found:
        if plc.is_cell(key, tables):
            file.note(key, "points.toml", said("mistake.no_cell"))
    return tables, columns
