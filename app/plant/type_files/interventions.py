"""`[<table>.interventions]` of tables.toml: a table whose rows are interventions of people, listed for the whole plant.

[force.interventions]
count = "forces"                    point: how many stand
remaining = "remaining"             column: time left [s]
owner = "owner"                     column: who asked, as in the command
record = "force"                    kind of record that tells why
release = "release"                 command that takes one back; its arguments are columns
release_all = "release_all"         command that takes all back
"""

from collections.abc import Collection, Mapping
from dataclasses import fields

from app.plant.definitions import Command, Interventions, TableMap
from app.plant.said import said
from app.plant.tables import Table, one_of


def read_interventions(table: Table, map: TableMap) -> Interventions | None:
    """What a table says of its rows; None when they are no interventions."""
    if not table.has("interventions"):
        return None
    row = table.table("interventions")
    found = Interventions(**{field.name: row.text(field.name) for field in fields(Interventions)})
    for key in ("remaining", "owner"):
        _check(row, key, getattr(found, key), map.columns, "column_of", table=map.key)
    row.done()
    return found


def check_interventions(
    file: Table,
    tables: Mapping[str, TableMap],
    *,
    points: Collection[str],
    commands: Mapping[str, Command],
    records: Collection[str],
) -> None:
    """What they name beside their own columns must be there."""
    for key, map in tables.items():
        if (of := map.interventions) is None:
            continue
        row = file.table(key).table("interventions")
        _check(row, "count", of.count, points, "point_known")
        _check(row, "record", of.record, records, "kind_known")
        for name in ("release", "release_all"):
            _check(row, name, getattr(of, name), commands, "command_known")
        release = commands.get(of.release)
        for argument in release.arguments if release else ():
            if argument.name not in map.columns:
                row.note("release", of.release, said("mistake.release_command", table=key, argument=argument.name))


def _check(row: Table, key: str, name: str, known: Collection[str], text: str, **of: str) -> None:
    if name and name not in known:
        row.note(key, name, said(f"mistake.{text}", known=one_of(sorted(known), name), **of))
