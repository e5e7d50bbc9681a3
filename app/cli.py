"""The command line: pogon run, simulate, check, selftest, reload, probe, inject, conform, export, user, audit, backup, restore …"""

# Each command imports what it needs when it is called: a web server and a database layer cost a second that `pogon --help` need not take.
import asyncio
import gc
import getpass
import os
import sys
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app import __version__
from app.addresses import host_and_port, is_loopback
from app.cli_access import audit_cli, user_cli
from app.cli_conform import conform
from app.cli_history import backup, backup_key, export, restore
from app.cli_probe import inject, probe
from app.errors import ConfigurationError

if TYPE_CHECKING:
    from app.plant.definitions import Plant
    from app.plant.problems import Problem
    from app.settings import Settings

WRONG_SETTINGS = 78
"""Exit code of a server whose settings are wrong whenever they are read: EX_CONFIG of sysexits.h; its unit tries no more."""
cli = typer.Typer(name="pogon", no_args_is_help=True, help=__doc__)
cli.add_typer(user_cli, name="user")
cli.add_typer(audit_cli, name="audit")
for command in (export, backup, backup_key, restore, probe, inject, conform):
    cli.command()(command)


def main() -> None:
    """Entry point of the console script."""
    _open_missing()
    for stream in (sys.stdout, sys.stderr):  # a terminal that lacks a letter gets "?", not half of what was to be said
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")
    cli()


def _open_missing() -> None:
    """Give a process that was started without standard files the empty one: else what it opens next is taken for them."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.dup2(os.open(os.devnull, os.O_RDWR), number)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w" if number else "r", closefd=False))


def _say_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"pogon {__version__}")
        raise typer.Exit


@cli.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_say_version, help="Print the version and stop.")
    ] = False,
) -> None:
    """Pogon: an open web HMI/SCADA."""


@cli.command()
def run(
    serve_modbus: Annotated[
        str,
        typer.Option(metavar="HOST:PORT", help="The simulated plant also answers Modbus TCP; else POGON_SERVE_MODBUS."),
    ] = "",
    begin_anew: Annotated[
        bool,
        typer.Option("--begin-anew", help="Put aside what is left of a plant whose database is lost; start a new one."),
    ] = False,
) -> None:
    """Start the plant and its web server (settings are POGON_ variables, see README)."""
    settings = settings_or_exit(WRONG_SETTINGS, **({"serve_modbus": serve_modbus} if serve_modbus else {}))
    gc.disable()  # nearly all that a start builds stays; the collector walks it again and again, a tenth of the time until the first page
    try:
        _run(settings, begin_anew)
    finally:
        gc.enable()  # at the latest: `Server.startup` does so


def _run(settings: "Settings", begin_anew: bool) -> None:
    """Serve the plant until a signal ends it; the exit code is 2 when it cannot be served with these settings."""
    from app.access.access import lock, prepare
    from app.access.former import begin_anew as put_aside
    from app.main import create_app
    from app.settings import check_places, unknown_settings
    from app.web.serve import serve

    for name in unknown_settings(os.environ):
        typer.echo(f"pogon: {name} is no setting of pogon, it is not used", err=True)
    os.umask(0o077)
    try:
        for line in check_places(settings):
            typer.echo(f"pogon: {line}", err=True)
        if begin_anew:
            held = lock(settings.data) if settings.data.is_dir() else None
            place = put_aside(settings.data)
            if place is not None:
                typer.echo(f"pogon: what was left of the plant before is in {place}", err=True)
            if held is not None:
                os.close(held)
        prepare(settings.data)
        lock(settings.data)
        serve(create_app(settings), settings)
    except ConfigurationError as error:
        for line in str(error).splitlines():
            typer.echo(f"pogon: {line}", err=True)
        raise typer.Exit(2) from error


@cli.command()
def simulate(
    folder: Annotated[Path, typer.Argument(metavar="PLANT", help="Plant folder, such as plants/demo.")],
    tcp: Annotated[str, typer.Option(metavar="HOST:PORT", help="Serve Modbus TCP; port 0 takes a free one.")] = "",
    serial: Annotated[str, typer.Option(metavar="PATH", help="Serve Modbus RTU on this serial device.")] = "",
    pty: Annotated[bool, typer.Option("--pty", help="Serve Modbus RTU on a new pseudo-terminal.")] = False,
    link: Annotated[str, typer.Option(help="Only the units of this link.")] = "",
    baud: Annotated[int | None, typer.Option(min=50, help="Baud rate; else that of the link.")] = None,
    parity: Annotated[str | None, typer.Option(help="none, even or odd; else that of the link.")] = None,
    beyond: Annotated[
        bool, typer.Option("--beyond", help="--tcp may listen beyond this machine: Modbus asks nobody who he is.")
    ] = False,
    turnaround: Annotated[float, typer.Option(min=0, max=10000, help="Time a device takes to answer, in ms.")] = 0.0,
    seed: Annotated[int, typer.Option(help="The same seed and writes repeat a run.")] = 1,
) -> None:
    """Serve the virtual devices of a plant to any Modbus master, in a process of their own."""
    from app.clock import SystemClock
    from app.sim.server import Openings
    from app.sim.server import simulate as serve_simulated

    try:
        address = _tcp_address(tcp) if tcp else None
        if address and not is_loopback(address[0]) and not beyond:
            raise ConfigurationError(
                f"--tcp {tcp} listens beyond this machine: expected 127.0.0.1, for whoever reaches it moves these machines; "
                "--beyond allows that"
            )
        openings = Openings(address, serial, pty, link, baud, parity, turnaround / 1000, seed)
        asyncio.run(serve_simulated(plant_or_exit(folder), SystemClock(), openings, typer.echo))
    except ConfigurationError as error:
        typer.echo(f"pogon: {error}", err=True)
        raise typer.Exit(2) from error


@cli.command()
def check(
    folder: Annotated[Path | None, typer.Argument(metavar="[PLANT]", help="Plant folder; else POGON_PLANT.")] = None,
    tests: Annotated[bool, typer.Option("--tests/--no-tests", help="Run the tests of its sequences.")] = True,
    strict: Annotated[bool, typer.Option("--strict", help="Warnings, too, make the exit code 1.")] = False,
) -> None:
    """Read a plant folder and list every mistake in it with file, line, key, value and what was expected.

    Warnings are what is taken as it is and seldom meant. The given/when/then tests of its sequences are run on simulated machines; one
    that fails makes the exit code 1.
    """
    from app.links.forecast import doubts
    from app.plant.plant_files.links import same_devices
    from app.plant.sequences import unused
    from app.sim.plant import clashes_of

    where = folder or settings_or_exit().plant
    plant = plant_or_exit(where)
    if clash := clashes_of(plant):
        typer.echo(f"pogon: {where}: {clash}: POGON_SERVE_MODBUS cannot serve them on one port", err=True)
        if os.environ.get("POGON_SERVE_MODBUS"):
            raise typer.Exit(2)
    if pairs := list(same_devices(plant.links)):
        for link, other in pairs:
            typer.echo(
                f"pogon: {where}/plant.toml: links.{link.name}.port = {link.port}: "
                f"expected another device than that of {other.name}, {other.port}: they are one here",
                err=True,
            )
        raise typer.Exit(2)
    idle = list(unused(plant))
    for name in idle:
        typer.echo(f"pogon: {where}/{name}: no equipment uses it", err=True)
    broken = [screen for screen in plant.screens.values() if screen.problems]
    mistakes = [problem for screen in broken for problem in screen.problems]
    for mistake in mistakes:
        typer.echo(f"pogon: {_placed(where, mistake)}", err=True)
    warnings = [doubt for doubt in (*plant.doubts, *doubts(plant)) if doubt not in mistakes]
    for warning in warnings:
        typer.echo(f"pogon: warning: {_placed(where, warning)}", err=True)
    alarms = sum(len(item.alarms) for item in plant.equipment.values())
    told = f"no mistakes, warnings: {len(warnings)}" if warnings else "no problems"
    if broken:
        told = (
            f"mistakes in {', '.join(f'/screens/{screen.name}' for screen in broken)}, which say so; the plant starts"
        )
    typer.echo(
        f"{where}: {told}. Equipment: {len(plant.equipment)}, links: {len(plant.links)}, "
        f"points: {len(plant.points)}, alarms: {alarms}, {_check_sums(plant)}languages: {', '.join(plant.languages)}"
    )
    passed = not tests or _tests_pass(plant)
    if not passed or broken or (strict and (warnings or idle)):
        raise typer.Exit(1)


def _check_sums(plant: "Plant") -> str:
    """What the PLCs of its sequences have to say of themselves."""
    from app.plant.sequences import checksum

    sums = {item.sequence.name: checksum(item.sequence) for item in plant.equipment.values() if item.sequence}
    named = ", ".join(f"{name} {number:08X}" for name, number in sorted(sums.items()))
    return f"check sums of sequences: {named}, " if sums else ""


def _tests_pass(plant: "Plant") -> bool:
    """Run the tests of every sequence, one that several machines share once for each kind of machine; one line for each test."""
    from app.sim.type_tests import tests_of

    done = 0
    failed = 0
    seen: list[tuple[object, ...]] = []
    for item in plant.equipment.values():
        machine = plant.equipment.get(item.machine)
        run_tests = tests_of(item.type.name)
        if run_tests is None or item.sequence is None or not item.sequence.tests:
            continue
        kind = (item.sequence, machine and machine.type.name, machine and machine.options)
        if kind in seen:
            continue
        seen.append(kind)
        try:
            results = run_tests(plant, item)
        except ConfigurationError as error:
            typer.echo(f"pogon: {item.id}: {error}", err=True)
            failed += 1
            continue
        for result in results:
            said = f"ok, {result.simulated:.1f} s in {result.took:.1f} s" if result.ok else f"FAILED: {result.happened}"
            typer.echo(f"{item.id}, {item.sequence.name}: {result.name}: {said}")
            failed += not result.ok
        done += len(results)
    if done or failed:
        typer.echo(f"Tests: {done}, failed: {failed}")
    return not failed


@cli.command()
def selftest(
    json_: Annotated[bool, typer.Option("--json", help="One JSON document instead of lines.")] = False,
    language: Annotated[str, typer.Option(help="hr, en, de or cs; else that of the terminal.")] = "",
) -> None:
    """Whether this machine can run Pogon with its settings: ports, rights, keys, clock, disk, databases, TLS, serial lines, plant.

    A line for each check; the exit code is 1 when one failed. It starts nothing, and may be run beside a server.
    """
    import json

    from app.clock import SystemClock
    from app.plant.texts import Texts, terminal_language
    from app.selftest import run_checks
    from app.sim.plant import clashes_of, read_simulated

    settings = settings_or_exit()
    texts = Texts.read()
    lang = language or terminal_language(os.environ, texts.languages)
    if lang not in texts.languages:
        typer.echo(f"pogon: --language {lang}: expected one of {', '.join(texts.languages)}", err=True)
        raise typer.Exit(2)
    counts = dict.fromkeys(("ok", "warning", "failed"), 0)
    told = []
    for finding in run_checks(settings, SystemClock(), read_simulated, clashes_of):
        counts[finding.state] += 1
        text = texts.text(lang, finding.key, **finding.params)
        told.append({"check": finding.check, "state": finding.state, "outcome": finding.outcome, "text": text})
        if not json_:
            typer.echo(f"{texts.text(lang, f'selftest.state.{finding.state}')}: {text}")
    if json_:
        typer.echo(json.dumps({"ok": not counts["failed"], "checks": told}, ensure_ascii=False, indent=1))
    else:
        said = {"failed": counts["failed"], "warnings": counts["warning"], "ok": counts["ok"]}
        typer.echo(texts.text(lang, "selftest.summary", **said))
    if counts["failed"]:
        raise typer.Exit(1)


@cli.command()
def reload(
    data: Annotated[Path | None, typer.Option("--data", help="Data folder of the server; else POGON_DATA.")] = None,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Take the changes without asking.")] = False,
    look: Annotated[bool, typer.Option("--look", help="Only say what would change.")] = False,
) -> None:
    """Let the running server take its plant files anew: says what changes, asks, and restarts only that."""
    from app.web.terminal import LOOK, ask

    folder = data or settings_or_exit().data
    try:
        found = ask(folder, LOOK, getpass.getuser())
        for problem in found["problems"]:
            typer.echo(f"pogon: {problem}", err=True)
        if found["problems"]:
            typer.echo("pogon: not taken, the plant runs on as it is", err=True)
            raise typer.Exit(2)
        if not found["changes"] and not found["first"]:
            typer.echo("The plant files are the plant that runs.")
            return
        typer.echo("\n".join(found["changes"]) or "The plant starts.")
        if look or not (yes or typer.confirm("Take these changes?")):
            return
        answer = ask(folder, found["digest"], getpass.getuser())
    except ConfigurationError as error:
        typer.echo(f"pogon: {error}", err=True)
        raise typer.Exit(2) from error
    if not answer["done"]:
        typer.echo(f"pogon: {' '.join(filter(None, (answer['refused'], answer['error'])))}", err=True)
        raise typer.Exit(1)
    typer.echo("Taken.")


def _tcp_address(text: str) -> tuple[str, int]:
    try:
        return host_and_port(text)
    except ConfigurationError as error:
        raise ConfigurationError(f"--tcp {text}: {error}") from error


def plant_or_exit(folder: Path) -> "Plant":
    """The plant in `folder`, or all its problems and exit code 2."""
    from app.sim.plant import read_simulated

    plant, problems = read_simulated(folder)
    for problem in problems:  # not many: `shortened`
        typer.echo(f"pogon: {_placed(folder, problem)}", err=True)
    if plant is None:
        raise typer.Exit(2)
    return plant


def _placed(folder: Path, problem: "Problem") -> str:
    """A mistake, or a warning, with the path of its file where that is of the plant folder itself."""
    from app.plant.loader import PLANT_FILE
    from app.plant.sequences import FOLDER

    place = f"{folder}/" if problem.file == PLANT_FILE or problem.file.startswith(f"{FOLDER}/") else ""
    return f"{place}{problem}"


def settings_or_exit(code: int = 2, **given: str) -> "Settings":
    """The settings, `given` before the environment; or one line per mistake and the exit code `code`."""
    from app.settings import read_settings

    try:
        return read_settings(**given)
    except ConfigurationError as error:
        for line in str(error).splitlines():
            typer.echo(f"pogon: {line}", err=True)
        raise typer.Exit(code) from error


if __name__ == "__main__":
    main()
