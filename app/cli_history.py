"""pogon export, backup, backup-key, restore: take history home, and everything else, and bring it back."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from zoneinfo import ZoneInfo, available_timezones

import typer

from app.cli_access import fail, opened, terminal
from app.errors import ConfigurationError, StorageError

if TYPE_CHECKING:
    from app.access.audit.kinds import Kind
    from app.backup import Manifest
    from app.db import Database
    from app.historian.export import Sheet
    from app.plant.definitions import Equipment, Plant

Data = Annotated[Path | None, typer.Option("--data", help="Data folder; else POGON_DATA.")]
PlantFolder = Annotated[Path | None, typer.Option("--plant", help="Plant folder; else POGON_PLANT.")]

KeyFile = Annotated[
    Path | None,
    typer.Option("--key-file", help="Key of the signature; else backup.key in the data folder, made when missing."),
]

ALL = "all"
"""Every machine."""
SHOWN_EVERY = 20_000
"""Rows between two lines of progress."""


def export(
    tags: Annotated[str, typer.Option(help="Tags, comma separated: m1.speed,m1.current")] = "",
    records: Annotated[
        str,
        typer.Option(
            metavar="KIND[:MACHINE]", help="Instead of tags: records of this kind, of all machines or of one."
        ),
    ] = "",
    events: Annotated[
        str, typer.Option(metavar="MACHINE", help="Instead of tags: all that this machine told, or that all did.")
    ] = "",
    begin: Annotated[
        str, typer.Option("--from", help="2026-03-09T06:00 (time of the plant), with offset, or -8h")
    ] = "-1h",
    end: Annotated[str, typer.Option("--to", help="As --from; or now.")] = "now",
    aggregate: Annotated[
        int, typer.Option(min=0, help="Seconds per row: min, max, first, last, mean, good %; 0: every sample.")
    ] = 0,
    by_shift: Annotated[
        bool,
        typer.Option("--by-shift", help="A row for each shift of the plant; of records and events: with their shift."),
    ] = False,
    locale: Annotated[str, typer.Option(help="Separator and decimal sign: hr, en, de, cs, machine.")] = "machine",
    bom: Annotated[bool, typer.Option("--bom", help="Mark the file as UTF-8 for spreadsheet programs.")] = False,
    rows: Annotated[int, typer.Option(min=0, help="Stop after so many rows; 0: never.")] = 0,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="File; else standard output.")] = None,
    timezone: Annotated[str, typer.Option(help="Zone of the local times; else the plant's.")] = "",
    data: Data = None,
    plant: PlantFolder = None,
) -> None:
    """History as CSV, samples, records or events, also beside a running server: it only reads.

    The file ends with its number of rows and its SHA-256.
    """
    from app.access.restoring import finish_restore
    from app.clock import SystemClock
    from app.db import Database
    from app.historian.export import Export, ExportSettings
    from app.historian.export import span as span_of
    from app.plant.loader import read_plant
    from app.plant.plant_files.shifts import USUAL
    from app.settings import read_settings

    database: Database | None = None
    made: Sheet
    try:
        settings = read_settings()
        finish_restore(data or settings.data)
        path = (data or settings.data) / "history.db"
        if not path.is_file():
            raise ConfigurationError(f"{path} is not there: nothing was recorded, or POGON_DATA is another folder")
        if out is not None and out.exists():
            raise ConfigurationError(f"{out} exists already: an export replaces no file")
        found, _ = read_plant(plant or settings.plant)
        zone, now = _zone(timezone, found), SystemClock().micros()
        if sum(map(bool, (tags, records, events))) != 1 or (aggregate and not tags):
            raise ConfigurationError("expected either --tags, or --records or --events without --aggregate")
        about: dict[str, Any] = {
            "zone": zone,
            "locale": locale,
            "bom": bom,
            "most_rows": rows,
            "plant": found.name.get("en", next(iter(found.name.values()))) if found else "",
            "person": terminal().name,
            "created": now,
            "simulated": found is not None and all(link.simulated for link in found.links.values()),
        }
        span = span_of(begin, end, zone, now)
        if by_shift and aggregate:
            raise ConfigurationError("expected either --by-shift or --aggregate")
        if by_shift:
            about["shifts"] = found.shifts if found else USUAL
        if records:
            made = _records(records, span, found, about)
        elif events:
            made = _events(events, span, found, about)
        else:
            named = [tag.strip() for tag in tags.split(",") if tag.strip()]
            made = Export(ExportSettings(tags=named, begin=span[0], end=span[1], interval=aggregate, **about))
        database = Database(path, "history", only_read=True)
        database.run(made.open)
        _write(made, database, out)
    except (ConfigurationError, StorageError) as error:
        fail(str(error))
    except BrokenPipeError:
        sys.stderr.close()
        raise typer.Exit(1) from None
    finally:
        if database:
            database.close()


def backup(
    file: Annotated[Path, typer.Argument(metavar="FILE.tar", help="New file; .tar.gz is compressed.")],
    with_keys: Annotated[
        bool,
        typer.Option(
            "--with-keys",
            help="Also audit.key, secret.key and factor.identity: whoever has them can write the audit anew and make codes.",
        ),
    ] = False,
    history: Annotated[bool, typer.Option("--history/--no-history", help="With or without history.db.")] = True,
    key_file: KeyFile = None,
    encrypt_to: Annotated[
        list[str] | None,
        typer.Option("--encrypt-to", metavar="age1…", help="Public key that may open it; may be repeated."),
    ] = None,
    data: Data = None,
    plant: PlantFolder = None,
) -> None:
    """Databases and plant folder in one signed file, verified by restoring it; also beside a running server."""
    from app import backup as archive
    from app.settings import read_settings

    try:
        settings = read_settings()
        folder, of = data or settings.data, plant or settings.plant
        manifest = archive.back_up(
            file,
            folder,
            of,
            keys=with_keys,
            history=history,
            key_file=key_file,
            encrypt_to=encrypt_to or (),
            tell=lambda text: typer.echo(text, err=True),
        )
    except ConfigurationError as error:
        fail(str(error))
    try:
        with opened(folder, existing=True) as access:
            sealed = bool(encrypt_to)
            entry = access.audit.entry(
                "backup.made", terminal(), file.name, keys=with_keys, history=history, encrypted=sealed
            )
            access.audit.run(lambda _connection: (None, [entry]))
    except typer.Exit:  # told; a disk that is full here does not make what lies elsewhere worse
        typer.echo(f"pogon: {file} is written and verified all the same; the audit has no line of it", err=True)
        raise
    typer.echo(f"{file}: {len(manifest.files)} files, verified. {_said(manifest)}")
    typer.echo(f"Its plant is {of}.")
    if key_file is None:
        typer.echo(
            f"Signed with {folder / archive.BACKUP_KEY}: to restore on another machine, keep a copy of it elsewhere."
        )
    if not with_keys:
        typer.echo("Without the keys: on another machine its audit cannot be verified (--with-keys takes them along).")


def restore(
    file: Annotated[Path, typer.Argument(metavar="FILE.tar", help="A file that pogon backup made.")],
    check: Annotated[bool, typer.Option("--check", help="Only verify the file, change nothing.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask.")] = False,
    key_file: KeyFile = None,
    identity: Annotated[
        list[Path] | None, typer.Option("--identity", help="File of age with the private key; may be repeated.")
    ] = None,
    unsigned: Annotated[
        bool, typer.Option("--unsigned", help="Believe a file whose signature is missing or cannot be checked here.")
    ] = False,
    data: Data = None,
    plant: Annotated[
        Path | None, typer.Option("--plant", help="New folder for the plant; else POGON_DATA/plant.")
    ] = None,
) -> None:
    """Bring a backup back. Not beside a running server: it says so.

    Nobody stays signed in, and no link writes until its plant file says so.
    """
    from app import backup as archive
    from app.access.private import check_entered
    from app.access.restoring import told
    from app.settings import read_settings

    begun = False
    try:
        folder = data or read_settings().data
        if not file.is_file():
            raise ConfigurationError(f"{file} is not there, or no ordinary file")
        check_entered(folder)
        key = archive.signing_key(key_file or folder / archive.BACKUP_KEY)
        if key_file and not key:
            raise ConfigurationError(f"{key_file} is not there")
        opening = archive.Opening(key, unsigned, identity or ())
        if check:
            manifest = archive.verify_backup(file, opening)
            _warn_unsigned(file, manifest)
            typer.echo(f"{file}: whole. {_said(manifest)}")
            return
        if (folder / "pogon.db").exists() and not yes:
            typer.confirm(f"{folder} has data; it is moved aside. Restore {file}?", abort=True)
        _note(folder, "backup.restoring", file, "sent")
        begun = True
        manifest, place = archive.restore(
            file, folder, plant, opening=opening, tell=lambda text: typer.echo(text, err=True)
        )
        _warn_unsigned(file, manifest)
    except ConfigurationError as error:
        if begun:
            _note(folder, "backup.restored", file, "failed", str(error))
        fail(str(error))
    verifiable = manifest.keys or (folder / "audit.key").exists()
    with opened(folder, existing=True) as access:
        entry = access.audit.entry(
            "backup.restored", terminal(), file.name, made=manifest.created, signed=manifest.signed
        )
        access.audit.run(lambda _connection: (None, [entry]))
    told(folder)
    typer.echo(f"restored into {folder}. {_said(manifest)}")
    if not verifiable:
        typer.echo(
            "The keys of its audit are not in it: pogon audit verify will say that the restored lines are broken."
        )
    typer.echo(
        f"plant: {place}; start with POGON_PLANT={place}. Links do not write: set writes = true where they shall."
    )


def backup_key(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="New file of the private key; keep it elsewhere.")],
) -> None:
    """Make a pair of keys for encrypted backups, as age-keygen does.

    The private key is only needed to restore: it does not belong on this machine.
    """
    from app.backup import make_identity

    try:
        public = make_identity(file)
    except ConfigurationError as error:
        fail(str(error))
    typer.echo(f"private key: {file}; move it to where backups are restored from")
    typer.echo(f"pogon backup --encrypt-to {public} …")


def _note(folder: Path, kind: "Kind", file: Path, result: str, reason: str = "") -> None:
    """Write a line into the audit of what is there before it is moved aside, and to syslog; one that takes none hinders no restore."""
    if not (folder / "pogon.db").is_file():
        return
    try:
        with opened(folder, existing=True, as_is=True) as access:
            entry = access.audit.entry(kind, terminal(), file.name, result=result, reason=reason)
            access.audit.run(lambda _connection: (None, [entry]))
    except typer.Exit:
        typer.echo("pogon: the audit of what is there takes no line of this restore", err=True)


def _warn_unsigned(file: Path, manifest: "Manifest") -> None:
    if not manifest.signed:
        typer.echo(f"pogon: {file}: its signature was not checked: anybody may have written it", err=True)


def _machine(
    option: str,
    machine: str,
    known: "list[Equipment]",
    span: tuple[int, int],
    plant: "Plant | None",
    about: dict[str, Any],
) -> str:
    """The machine that `option` names, empty for all; refuses what cannot be exported."""
    from app.historian.export import FORMATS

    if about["locale"] not in FORMATS:
        raise ConfigurationError(f"locale: {about['locale']}, expected one of {', '.join(FORMATS)}")
    ids = [item.id for item in known]
    if machine != ALL and plant is not None and machine not in ids:
        raise ConfigurationError(f"{option} {machine}: expected {', '.join((*ids, ALL))}")
    return "" if machine == ALL else machine


def _events(machine: str, span: tuple[int, int], plant: "Plant | None", about: dict[str, Any]) -> "Sheet":
    """The export of what `machine`, or `all`, told."""
    from app.historian.event_search import EventFilter
    from app.historian.event_sheet import EventExport, EventExportSettings, with_ring, words
    from app.plant.texts import Texts

    equipment = _machine("--events", machine, with_ring(plant), span, plant, about)
    return EventExport(
        EventExportSettings(EventFilter(equipment, *span), **words(Texts.read(plant), plant, about["locale"]), **about)
    )


def _records(asked: str, span: tuple[int, int], plant: "Plant | None", about: dict[str, Any]) -> "Sheet":
    """The export of the records of a kind: `run`, or `run:seq1` of one machine."""
    from app.historian.export import FORMATS
    from app.historian.record_export import RecordExport, RecordExportSettings, keeping, kinds, names, words
    from app.historian.record_query import RecordFilter
    from app.plant.texts import Texts

    if about["locale"] not in FORMATS:
        raise ConfigurationError(f"locale: {about['locale']}, expected one of {', '.join(FORMATS)}")
    known = kinds(plant)
    name, _, machine = asked.partition(":")
    kind = known.get(name)
    if kind is None:
        raise ConfigurationError(
            f"--records {asked}: expected {', '.join(known) or 'a plant whose machines have records'}"
        )
    machines = [item.id for item in keeping(plant, name)]
    if machine not in ("", ALL, *machines):
        raise ConfigurationError(
            f"--records {asked}: expected {name} or {', '.join(f'{name}:{one}' for one in machines)}"
        )
    equipment = "" if machine == ALL else machine
    settings = RecordExportSettings(
        RecordFilter(equipment, *span), kind=kind, **words(Texts.read(plant), plant, kind, about["locale"]), **about
    )
    return RecordExport(replace(settings, names=names(plant, kind, equipment, settings.label)))


def _write(made: "Sheet", database: "Database", out: Path | None) -> None:
    """Write all portions, and check the file as it lies on the disk."""
    from app.historian.export import verify_export

    shown = 0
    part = out.with_name(out.name + ".part") if out else None
    try:
        sink = part.open("xb") if part else sys.stdout.buffer
    except OSError as error:
        raise ConfigurationError(
            f"{out}: expected a new file in a folder that can be written ({error.strerror})"
        ) from error
    try:
        while not made.done:
            sink.write(database.run(made.read))
            if made.rows - shown >= SHOWN_EVERY or (made.done and out):
                shown = made.rows
                typer.echo(f"\r{made.rows} rows, {made.progress:.0%}", err=True, nl=made.done)
        sink.flush()
        if part and out:
            sink.close()
            found = verify_export(part)
            if not found.ok:
                raise StorageError(f"{part}: {found.why}")
            part.rename(out)
            typer.echo(f"{out}: {made.rows} rows, checksum verified", err=True)
    except OSError as error:
        if isinstance(error, BrokenPipeError):
            raise
        raise StorageError(f"{out or 'standard output'}: {error.strerror or error}") from error
    finally:
        if part:
            sink.close()
            part.unlink(missing_ok=True)
    if not made.complete:
        typer.echo(f"stopped at the limit of {made.rows} rows", err=True)


def _zone(name: str, plant: "Plant | None") -> ZoneInfo:
    if name and name not in available_timezones():
        raise ConfigurationError(f"--timezone {name}: expected a name like Europe/Zagreb")
    if not name and plant is None:
        typer.echo("pogon: the plant cannot be read, local times are UTC (--timezone names a zone)", err=True)
    return ZoneInfo(name or (plant.timezone if plant else "UTC"))


def _said(manifest: "Manifest") -> str:
    history = manifest.counts.get("history.db", {}).get("sample")
    people = manifest.counts.get("pogon.db", {}).get("person", 0)
    samples = "no history" if history is None else f"{history} samples"
    return f"Made {manifest.created} by {manifest.version}: {people} people, {samples}, keys {'in it' if manifest.keys else 'not in it'}."
