"""pogon conform: which rules of the register map the server of a PLC keeps, a line for each.

Exit codes: 0 every rule that was judged is kept · 1 one is broken · 2 none was judged: what was asked makes no sense, or nobody is there.
"""

import asyncio
import json
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.addresses import host_and_port
from app.errors import ConfigurationError, NoAnswer, NotConnected

if TYPE_CHECKING:
    from app.links.conformance.finding import Finding
    from app.links.conformance.server import Exchange
    from app.links.tcp import TcpTransport
    from app.plant.problems import Problem
    from app.plant.texts import Texts
    from app.plant.type_files.data import TypeData

PAGE = "docs/registers/{}.md"


def conform(
    tcp: Annotated[str, typer.Option(metavar="HOST:PORT", help="Where the PLC answers Modbus TCP.")],
    kind: Annotated[str, typer.Option("--type", metavar="TYPE", help="Equipment type whose map it serves.")],
    plant: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Plant folder whose own types, equipment/TYPE, are known, too."),
    ] = None,
    unit: Annotated[int, typer.Option(min=0, max=255, help="Unit.")] = 1,
    write: Annotated[
        bool,
        typer.Option(
            "--write",
            help="Also the rules that cannot be seen without writing: a heartbeat, a hold-to-run without a button, settings that are "
            "staged and not committed, commands that must be refused. Nothing moves; a button that somebody holds is let go.",
        ),
    ] = False,
    option: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=NUMBER",
            help="What the plant file says of how many the machine has (belts=5, merges=1); may be repeated. Else as many as usual.",
        ),
    ] = None,
    patience: Annotated[int, typer.Option(min=50, max=60000, help="Time the PLC is given to answer, in ms.")] = 2000,
    json_: Annotated[bool, typer.Option("--json", help="One JSON document instead of lines.")] = False,
    language: Annotated[str, typer.Option(help="hr, en, de or cs; else that of the terminal.")] = "",
) -> None:
    """Tell a PLC programmer which rules of the register map his server keeps, and which it breaks: what was seen, what was expected, and
    where it is documented. Only reads, unless --write."""
    from app.plant import types
    from app.plant.texts import Texts, terminal_language

    try:
        host, port = _host(tcp)
        texts = Texts.read()
        lang = language or terminal_language(os.environ, texts.languages)
        if lang not in texts.languages:
            raise ConfigurationError(f"--language {lang}: expected one of {', '.join(texts.languages)}")
        given = _given(option or ())
        data = _type(kind, given, _Types(plant, texts.languages))
        found = asyncio.run(_examine(host, port, unit, patience / 1000, data, write=write))
    except (ConfigurationError, NotConnected) as error:
        for line in str(error).splitlines():
            typer.echo(f"pogon: {line}", err=True)
        raise typer.Exit(2) from error
    states = Counter(finding.state.value for finding in found)
    page = PAGE.format(kind) if data.type.folder.parent == types.EQUIPMENT else f"{types.OWN}/{kind}"
    if json_:
        rules = [_record(finding, page, texts, lang) for finding in found]
        document = {
            "ok": not states["broken"],
            "server": tcp,
            "unit": unit,
            "type": kind,
            "options": given,
            "wrote": write,
            "rules": rules,
        }
        typer.echo(json.dumps(document, ensure_ascii=False, indent=1))
    else:
        for finding in found:
            typer.echo(_line(finding, page, texts, lang))
        said = {name: states[name] for name in ("kept", "broken", "skipped")}
        typer.echo(texts.text(lang, "conform.summary", **said))
    if states["broken"]:
        raise typer.Exit(1)


def _line(finding: "Finding", page: str, texts: "Texts", lang: str) -> str:
    state = texts.text(lang, f"conform.state.{finding.state.value}")
    line = f"{state}: {finding.rule}: {texts.text(lang, f'conform.rule.{finding.rule}')}"
    if finding.state == "broken":
        seen, expected = (_worded(text, texts, lang) for text in (finding.seen, finding.expected))
        told = {"seen": seen, "expected": expected, "where": _where(finding, page)}
        return f"{line}\n    {texts.text(lang, 'conform.seen', **told)}"
    if finding.state == "skipped":
        return f"{line} ({texts.text(lang, f'conform.why.{finding.why}', rule=finding.needs)})"
    return line


def _worded(found: str, texts: "Texts", lang: str) -> str:
    """What was seen or expected, its words (`finding.WORDS`) in `lang`."""
    from app.links.conformance.finding import WORDS

    for word in WORDS:
        found = found.replace(f"{{{word}}}", texts.text(lang, f"conform.word.{word}"))
    return found


def _record(finding: "Finding", page: str, texts: "Texts", lang: str) -> dict[str, str]:
    text = texts.text(lang, f"conform.rule.{finding.rule}")
    told = {"rule": finding.rule, "state": finding.state.value, "text": text, "documented": _where(finding, page)}
    if finding.state == "broken":
        told |= {key: _worded(getattr(finding, key), texts, lang) for key in ("seen", "expected")}
    told |= {"why": finding.why} if finding.why else {}
    return told | ({"needs": finding.needs} if finding.needs else {})


def _where(finding: "Finding", page: str) -> str:
    return f"{page}: {finding.section}" if finding.section else page


async def _examine(
    host: str, port: int, unit: int, patience: float, data: "TypeData", *, write: bool
) -> "list[Finding]":
    from app.links.conformance.examination import examine
    from app.links.tcp import TcpTransport
    from app.plant.definitions import Link

    transport = TcpTransport(Link("conform", "tcp", host=host, tcp_port=port))
    await transport.connect()
    try:
        return [finding async for finding in examine(_exchange(transport, unit, patience), data, write=write)]
    finally:
        await transport.close()


def _exchange(transport: "TcpTransport", unit: int, patience: float) -> "Exchange":
    async def exchange(pdu: bytes) -> bytes:
        if not transport.connected:
            await transport.connect()
        try:
            return await transport.exchange(unit, pdu, patience)
        except NotConnected as error:  # a server that hangs up instead of answering says nothing, too
            raise NoAnswer(str(error)) from error

    return exchange


def _given(options: Sequence[str]) -> dict[str, float]:
    given = {}
    for text in options:
        name, equals, number = text.partition("=")
        try:
            given[name] = float(number)
        except ValueError:
            equals = ""
        if not equals:
            raise ConfigurationError(f"--option {text}: expected NAME=NUMBER, such as belts=5")
    return given


class _Types:
    """The types that are known: ours, and those of a plant folder."""

    def __init__(self, plant: Path | None, languages: Sequence[str]) -> None:
        """Raises:
        ConfigurationError: the folder brings no type.
        """
        from app.plant import types

        self._plant, self._languages = plant, languages
        self._own = types.names(plant / types.OWN) if plant else []
        if plant and not self._own:
            raise ConfigurationError(f"--plant {plant}: expected a plant folder with {types.OWN}/<type>/device.toml")
        self.names = sorted({*types.names(), *self._own})

    def read(self, name: str, given: Mapping[str, float]) -> "tuple[TypeData, list[Problem]]":
        """A type with as many of everything as `given` says, and what is wrong with it."""
        from app.plant import types

        if self._plant is None or name not in self._own or name in types.names():
            return types.read_type(name, ["en"], given=given)
        return types.read_own_type(name, self._languages, self._plant, spoken=self._languages, given=given)


def _type(name: str, given: Mapping[str, float], known_types: _Types) -> "TypeData":
    found = {}
    for each in known_types.names:
        data, problems = known_types.read(each, {})
        if problems and each == name:
            raise ConfigurationError("\n".join(map(str, problems)))
        if not problems and data.type.device.plc:
            found[each] = data
    if name not in found:
        raise ConfigurationError(f"--type {name}: expected one of {', '.join(found)}")
    usual = found[name]
    for option, value in given.items():
        if option not in usual.counted:
            known = (
                f"one of {', '.join(sorted(usual.counted))}" if usual.counted else f"none: a {name} has no such numbers"
            )
            raise ConfigurationError(f"--option {option}={value:g}: expected {known}")
        low, high = usual.type.ranges[option]
        if not low <= value <= high or value % 1:
            raise ConfigurationError(f"--option {option}={value:g}: expected a whole number from {low:g} to {high:g}")
    if not given:
        return usual
    data, problems = known_types.read(name, given)
    if problems:
        raise ConfigurationError("\n".join(map(str, problems)))
    return data


def _host(text: str) -> tuple[str, int]:
    try:
        host, port = host_and_port(text)
    except ConfigurationError as error:
        raise ConfigurationError(f"--tcp {text}: {error}") from error
    if port == 0:
        raise ConfigurationError(f"--tcp {text}: expected the port that is really open, not 0")
    return host, port
