"""The terminal's way to a running server: a Unix socket in POGON_DATA that only its owner (mode 0600) or root can open.

One line of JSON each way: {"reload": "look"} or {"reload": "<digest>"} → {"problems", "changes": [lines], "digest", "done", "refused"}.
"""

import asyncio
import json
import logging
import os
import socket
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.access.audit.line import printable
from app.access.roles import Person
from app.errors import ConfigurationError
from app.plant.changes import Change
from app.plant.texts import Texts

if TYPE_CHECKING:
    from app.running.plant_files import Reading
    from app.runtime import Runtime

log = logging.getLogger(__name__)

NAME = "server.socket"
LONGEST = 4096
"""Of a request [bytes]."""
PATIENCE = 60.0
"""The server answers within this [s]."""
FIRST_WORD = 5.0
"""A terminal that says nothing for so long is hung up on [s]."""
LOOK = "look"


@asynccontextmanager
async def listening(runtime: "Runtime") -> AsyncIterator[None]:
    """Answer terminals while the context lasts. A socket that cannot be opened is told in the log and does not stop the server."""
    path = runtime.settings.data / NAME

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            async with asyncio.timeout(FIRST_WORD):
                line = await reader.readline()
            writer.write(json.dumps(await _answer(runtime, line)).encode() + b"\n")
            await writer.drain()
        except (TimeoutError, ValueError, ConnectionError) as error:
            log.info("terminal not understood reason=%s", error)
        finally:
            writer.close()
            with suppress(ConnectionError):
                await writer.wait_closed()

    try:
        server = await asyncio.start_unix_server(serve, sock=_bound(path), limit=LONGEST)
    except OSError as error:
        log.error("no terminal at %s reason=%s: pogon reload does not work", path, error)
        yield
        return
    try:
        yield
    finally:
        server.close()
        path.unlink(missing_ok=True)


def ask(data: Path, request: str, person: str) -> dict[str, Any]:
    """Send a terminal's request to the server that runs on the folder `data`; its answer.

    Raises:
        ConfigurationError: no server runs there, or it does not answer.
    """
    try:
        with _reached(data) as address, socket.socket(socket.AF_UNIX) as line:
            line.settimeout(PATIENCE)
            line.connect(address)
            line.sendall(json.dumps({"reload": request, "person": person}).encode() + b"\n")
            with line.makefile("r", encoding="utf-8") as answer:
                found: dict[str, Any] = json.loads(answer.readline())
                return found
    except FileNotFoundError as error:
        raise ConfigurationError(f"POGON_DATA={data}: no server runs on it") from error
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"POGON_DATA={data}: the server does not answer ({error})") from error


def lines(change: Change, texts: Texts, lang: str) -> list[str]:
    """One change in words: what, the keys, the consequences."""
    head = texts.text(
        lang, f"plant.{change.kind}", what=texts.text(lang, f"plant.what.{change.what}"), name=change.name
    )
    effects = [texts.text(lang, f"plant.effect.{effect.key}", **effect.params) for effect in change.effects]
    return [head, *(f"    {detail}" for detail in change.details), *(f"    → {effect}" for effect in effects)]


async def _answer(runtime: "Runtime", line: bytes) -> dict[str, Any]:
    request = json.loads(line)
    match request:
        case {"reload": str(path), "person": str(name)}:
            label = printable(f"terminal:{name}", 64)
            person = Person(0, label, label, frozenset(), frozenset(), "", address="terminal")
            reading = await (runtime.plant_files.look() if path == LOOK else runtime.plant_files.reload(person, path))
            return _told(reading)
    raise ValueError("unknown request")


def _told(reading: "Reading") -> dict[str, Any]:
    texts = Texts.read()
    return {
        "problems": [str(problem) for problem in reading.problems],
        "changes": [line for change in reading.changes for line in lines(change, texts, "en")],
        "digest": reading.digest,
        "first": reading.first,
        "done": reading.done,
        "refused": texts.text("en", reading.refused) if reading.refused else "",
        "error": reading.error,
    }


def _bound(path: Path) -> socket.socket:
    """A listening socket at `path`, private from its first moment on; what a killed server left is replaced."""
    path.unlink(missing_ok=True)
    line = socket.socket(socket.AF_UNIX)
    try:
        former = os.umask(0o177)
        try:
            with _reached(path.parent) as address:
                line.bind(address)
        finally:
            os.umask(former)
        line.listen(4)
        line.setblocking(False)
        return line
    except OSError:
        line.close()
        raise


@contextmanager
def _reached(data: Path) -> Iterator[str]:
    """The address of the socket in `data`; a long path goes by way of the folder's handle, for an address holds 107 bytes."""
    address = str(data / NAME)
    if len(os.fsencode(address)) < 100:
        yield address
        return
    handle = os.open(data, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{handle}/{NAME}"
    finally:
        os.close(handle)
