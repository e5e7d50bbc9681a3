"""Opens a simulated line to any Modbus master: on a TCP port, a serial device, or a pseudo-terminal.

The framing is our own: pymodbus' server cannot be silent, late or garbled for one request, answers an unknown unit with
exception 04, and does not keep the time of a serial line. Units that are not there are silent on TCP too.
"""

import asyncio
import contextlib
import logging
import os
import signal
import socket
import tty
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from struct import Struct
from typing import Any

import serial  # type: ignore[import-untyped]

from app.addresses import as_written
from app.clock import Clock
from app.errors import ConfigurationError
from app.plant.definitions import Plant
from app.registers.pdu import MAX_PDU, READ_WRITE, WRITE_COILS, WRITE_MULTIPLE
from app.registers.rtu import Framer, build_frame, character_time, silence
from app.sim.bus import Answer, Bus, damaged
from app.sim.plant import SimPlant

log = logging.getLogger(__name__)

MBAP = Struct(">HHHB")
"""Transaction, protocol (0), length of what follows it, unit."""
COUNTED = (WRITE_COILS, WRITE_MULTIPLE, READ_WRITE)
"""Functions whose requests say how many bytes they bring: more than a telegram holds can be asked for."""
LONGEST = 10 + 255
"""The longest of these PDUs, that of function 23 with a full byte count."""
MAX_CONNECTIONS = 64
SEND_TIMEOUT = 5.0
"""A client that does not take its answers for so long is dropped [s]."""
IDLE_GRACE = 60.0
"""A connection idle for longer makes room for a new one when all are taken [s]."""
SERIAL_PATIENCE = 0.02
"""A USB adapter hands a telegram over in pieces up to its latency timer (FTDI 16 ms) apart [s]."""
REOPEN_PAUSE = 1.0
"""Between two tries to open a serial device that went away [s]."""
PARITIES = {"none": serial.PARITY_NONE, "even": serial.PARITY_EVEN, "odd": serial.PARITY_ODD}


class TcpServer:
    """A Modbus TCP server for one bus. Each connection gets its answers in the order of its requests."""

    def __init__(self, bus: Bus, *, max_connections: int = MAX_CONNECTIONS) -> None:
        self._bus = bus
        self._max = max_connections
        self._server: asyncio.Server | None = None
        self._clients: dict[asyncio.Task[None], float] = {}
        self._turn = asyncio.Lock()
        """One request of all clients is answered in a turn of the loop: those that flood the port keep nobody beside it waiting."""
        self.address: tuple[str, int] = ("", 0)
        """Host and port that it really listens on."""

    @property
    def connections(self) -> int:
        """Clients connected now."""
        return len(self._clients)

    async def start(self, host: str, port: int) -> None:
        """Listen on `host`:`port`; port 0 takes a free one.

        Raises:
            ConfigurationError: the address is taken, not ours, or not allowed.
        """
        try:
            self._server = await asyncio.start_server(self._accept, host, port, limit=8192)
        except (OSError, OverflowError) as error:
            raise ConfigurationError(
                f"tcp {as_written(host, port)}: expected a free address of this machine ({error})"
            ) from error
        self.address = self._server.sockets[0].getsockname()[:2]

    async def close(self) -> None:
        """Stop listening and drop every client."""
        if self._server is None:
            return
        self._server.close()
        for task in list(self._clients):
            task.cancel()
        await asyncio.gather(*self._clients, return_exceptions=True)
        await self._server.wait_closed()
        self._server = None

    def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if not self._has_room():
            writer.close()
            return
        task = asyncio.get_running_loop().create_task(self._serve(reader, writer), name="modbus tcp client")
        self._clients[task] = asyncio.get_running_loop().time()
        task.add_done_callback(lambda done: self._clients.pop(done, None))

    def _has_room(self) -> bool:
        if len(self._clients) < self._max:
            return True
        idlest = min(self._clients, key=lambda task: self._clients[task])
        if asyncio.get_running_loop().time() - self._clients[idlest] < IDLE_GRACE:
            return False
        del self._clients[idlest]
        idlest.cancel()
        return True

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        link = writer.get_extra_info("socket")
        link.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        try:
            while await self._serve_one(reader, writer):
                pass
        except (asyncio.IncompleteReadError, ConnectionError, TimeoutError, OSError):
            pass
        finally:
            # abort, not close: a client that does not read would keep the socket and its buffer for ever
            writer.transport.abort()

    async def _serve_one(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> bool:
        """Take one request and answer it; False when what came is not Modbus, where no resynchronising is possible."""
        transaction, protocol, length, unit = MBAP.unpack(await reader.readexactly(MBAP.size))
        if protocol != 0 or not 2 <= length <= LONGEST + 1:
            return False
        function = await reader.readexactly(1)
        if length > MAX_PDU + 1 and function[0] not in COUNTED:
            return False
        pdu = function + await reader.readexactly(length - 2)
        self._note_use()
        if len(pdu) > MAX_PDU:  # 124 registers, of a master that does not count them: refused, not hung up on
            pdu = function
        async with self._turn:
            answer = self._bus.answer(unit, pdu)
            await asyncio.sleep(0)
        if answer.pdu is None:
            return True
        if answer.delay > 0:
            await asyncio.sleep(answer.delay)
        body = damaged(answer.pdu) if answer.corrupt == "crc" else answer.pdu
        writer.write(MBAP.pack(transaction, 0, len(body) + 1, answer.unit) + body)
        async with asyncio.timeout(SEND_TIMEOUT):
            await writer.drain()
        return True

    def _note_use(self) -> None:
        task = asyncio.current_task()
        if task in self._clients:
            self._clients[task] = asyncio.get_running_loop().time()


async def serve_tcp(bus: Bus, host: str, port: int, *, max_connections: int = MAX_CONNECTIONS) -> TcpServer:
    """Serve `bus` on `host`:`port` (0 = any free port, see `address`) until `close()`.

    Raises:
        ConfigurationError: the address cannot be listened on.
    """
    server = TcpServer(bus, max_connections=max_connections)
    await server.start(host, port)
    return server


class SerialServer:
    """A Modbus RTU slave line for one bus.

    A real UART keeps the time of the line by itself. A pseudo-terminal does not: there the server does (`paced`), with request,
    silence and answer each taking what they take at `baud`. The answer is handed over in one piece when its last
    character would have arrived; delivered in dribbles, a busy computer would make silences of the gaps.
    """

    def __init__(self, bus: Bus, open_line: Callable[[], "_Line"], path: str, baud: int, *, paced: bool) -> None:
        self._bus = bus
        self._open = open_line
        self._baud = baud
        self._paced = paced
        self._framer = Framer(silence(baud), 0.0 if paced else SERIAL_PATIENCE)
        self._heard: asyncio.Queue[tuple[float, int, bytes]] = asyncio.Queue(16)
        self._lost = asyncio.Event()
        self._timer: asyncio.TimerHandle | None = None
        self._free = 0.0
        self._line: _Line | None = None
        self._tasks: list[asyncio.Task[None]] = []
        self.path = path
        """Device that the master, or its cable, is connected to."""

    async def start(self) -> None:
        """Open the line.

        Raises:
            ConfigurationError: the device cannot be opened, or does not take baud or parity.
        """
        try:
            self._listen(self._open())
        except (OSError, ValueError) as error:  # SerialException is an OSError
            raise ConfigurationError(
                f"serial {self.path}: expected a serial device at {self._baud} baud ({error})"
            ) from error
        loop = asyncio.get_running_loop()
        self._tasks = [loop.create_task(self._reopen()), loop.create_task(self._answer_all())]

    async def close(self) -> None:
        """Stop answering and give the device back."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._tasks = []
        self._drop_line()

    def _listen(self, line: "_Line") -> None:
        self._line = line
        self._lost.clear()
        asyncio.get_running_loop().add_reader(line.fileno, self._readable)

    def _drop_line(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        if self._line is not None:
            asyncio.get_running_loop().remove_reader(self._line.fileno)
            self._line.close()
            self._line = None

    async def _reopen(self) -> None:
        """A device that goes away (adapter unplugged, other end closed) is opened again when it is back."""
        while True:
            await self._lost.wait()
            self._drop_line()
            log.warning("serial line lost path=%s", self.path)
            while self._line is None:
                await asyncio.sleep(REOPEN_PAUSE)
                with contextlib.suppress(OSError, ValueError):
                    self._listen(self._open())
            log.info("serial line back path=%s", self.path)

    def _readable(self) -> None:
        loop = asyncio.get_running_loop()
        if self._line is None:
            return
        try:
            data = os.read(self._line.fileno, 4096)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            loop.remove_reader(self._line.fileno)
            self._lost.set()
            return
        self._framer.feed(data, loop.time())
        if self._timer is not None:
            self._timer.cancel()
        due = self._framer.due
        self._timer = loop.call_at(due if due is not None else loop.time(), self._silent)

    def _silent(self) -> None:
        began = self._framer.began
        telegram = self._framer.take()
        if telegram is not None and not self._heard.full():
            self._heard.put_nowait((began, *telegram))

    async def _answer_all(self) -> None:
        while True:
            began, unit, pdu = await self._heard.get()
            await self._answer(began, unit, pdu)

    async def _answer(self, began: float, unit: int, pdu: bytes) -> None:
        """Answer one request at the time at which the line would carry the answer's last character."""
        character = character_time(self._baud) if self._paced else 0.0
        pause = silence(self._baud) if self._paced else 0.0
        # a master that does not wait for the silence behind our answer cannot be faster than the line either
        end = max(began, self._free + pause) + (len(pdu) + 3) * character
        await _until(end + pause)
        answer = self._bus.answer(unit, pdu)
        frame = _frame(answer)
        if not frame:
            self._free = end
            return
        end = max(end + pause, 0.0 if self._paced else asyncio.get_running_loop().time()) + answer.delay
        end += len(frame) * character
        await _until(end)
        self._free = end
        if self._line is not None:
            # a line that nobody reads fills up and loses characters, as a wire does; a lost one is found by the reader
            with contextlib.suppress(OSError):
                os.write(self._line.fileno, frame)


class _Line:
    """An open device: what to read and write, and what to close."""

    def __init__(self, fileno: int, close: Callable[[], None]) -> None:
        self.fileno = fileno
        self.close = close


async def serve_serial(
    bus: Bus, path: str, baud: int = 9600, parity: str = "none", *, stop_bits: int = 1, paced: bool | None = None
) -> SerialServer:
    """Serve `bus` as RTU slaves on the serial device `path` until `close()`.

    `parity` none, even or odd; `paced` None: only a pseudo-terminal is paced by us.

    Raises:
        ConfigurationError: the device, the baud rate or the parity cannot be had.
    """
    if parity not in PARITIES:
        raise ConfigurationError(f"parity {parity}: expected one of {', '.join(PARITIES)}")
    if baud <= 0:
        raise ConfigurationError(f"baud {baud}: expected a rate above 0, such as 9600")

    def open_line() -> _Line:
        port = serial.Serial(path, baud, parity=PARITIES[parity], stopbits=stop_bits, timeout=0, exclusive=True)
        port.reset_input_buffer()
        return _Line(port.fileno(), port.close)

    server = SerialServer(bus, open_line, path, baud, paced=_is_pseudo_terminal(path) if paced is None else paced)
    await server.start()
    return server


async def serve_pty(bus: Bus, baud: int = 9600, *, paced: bool = True) -> SerialServer:
    """Serve `bus` as RTU slaves on a new pseudo-terminal until `close()`; masters open its `path` (parity none).

    Both ends stay open here, so masters may come and go.
    """
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)

    def close() -> None:
        os.close(ours)
        os.close(theirs)

    server = SerialServer(bus, lambda: _Line(ours, close), os.ttyname(theirs), baud, paced=paced)
    await server.start()
    return server


def _is_pseudo_terminal(path: str) -> bool:
    return str(Path(path).resolve()).startswith("/dev/pts/")


def _frame(answer: Answer) -> bytes:
    """The bytes of `answer` on a serial line; empty for silence."""
    if answer.pdu is None:
        return b""
    if answer.corrupt == "garbage":
        return answer.pdu
    frame = build_frame(answer.unit, answer.pdu)
    return frame[:-1] + bytes((frame[-1] ^ 0xFF,)) if answer.corrupt == "crc" else frame


async def _until(moment: float) -> None:
    pause = moment - asyncio.get_running_loop().time()
    if pause > 0:
        await asyncio.sleep(pause)


Server = TcpServer | SerialServer


async def close_all(servers: Sequence[Server]) -> None:
    """Close `servers`, each whatever became of the others."""
    await asyncio.gather(*(server.close() for server in servers), return_exceptions=True)


@dataclass(frozen=True, slots=True)
class Openings:
    """Where a simulated plant is to be reachable; at least one of `tcp`, `serial` and `pty`."""

    tcp: tuple[str, int] | None = None
    serial: str = ""
    """Path of a serial device."""
    pty: bool = False
    link: str = ""
    """Serve this link only; empty = all."""
    baud: int | None = None
    """None = that of the links."""
    parity: str | None = None
    """Of `serial`; None = that of the links. A pseudo-terminal has none."""
    turnaround: float = 0.0
    """Time that a device takes for an answer [s]."""
    seed: int = 1


async def simulate(plant: Plant, clock: Clock, openings: Openings, say: Callable[[str], None]) -> None:
    """Run the virtual devices of `plant` and serve them until SIGINT or SIGTERM.

    Tells `say` each unit, each opening with the address it really has, and `ready`.

    Raises:
        ConfigurationError: nothing to open, an opening that cannot be had, units that collide.
    """
    if not (openings.tcp or openings.serial or openings.pty):
        raise ConfigurationError("nothing to serve on: expected --tcp HOST:PORT, --serial PATH or --pty")
    if openings.parity and openings.parity not in PARITIES:
        raise ConfigurationError(f"parity {openings.parity}: expected one of {', '.join(PARITIES)}")
    if openings.pty and not openings.serial and openings.parity not in (None, "none"):
        raise ConfigurationError(f"parity {openings.parity}: expected none, a pseudo-terminal has no parity")
    links = [openings.link] if openings.link else None
    simulation = SimPlant(plant, clock, seed=openings.seed, links=links, turnaround=openings.turnaround)
    if not simulation.equipment:
        raise ConfigurationError(f"link {openings.link or 'any'}: expected at least one equipment on it")
    bus = simulation.merged()
    for item in sorted(simulation.equipment.values(), key=lambda item: item.unit):
        say(f"unit {item.unit} {item.id} {item.type.name}")
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop.set)
    servers: list[Server] = []
    moving = loop.create_task(simulation.run(), name="simulated plant")
    waiting = loop.create_task(stop.wait())
    try:
        await _open(bus, plant, simulation, openings, servers, say)
        say("ready")
        await asyncio.wait((moving, waiting), return_when=asyncio.FIRST_COMPLETED)
        if moving.done():
            moving.result()
    finally:
        for task in (moving, waiting):
            task.cancel()
        await asyncio.gather(moving, waiting, return_exceptions=True)
        await close_all(servers)
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.remove_signal_handler(number)


async def _open(
    bus: Bus,
    plant: Plant,
    simulation: SimPlant,
    openings: Openings,
    servers: list[Server],
    say: Callable[[str], None],
) -> None:
    links = [plant.links[name] for name in sorted({item.link for item in simulation.equipment.values()})]
    if openings.tcp:
        tcp = await serve_tcp(bus, *openings.tcp)
        servers.append(tcp)
        say(f"tcp {as_written(*tcp.address)}")
    if openings.pty or openings.serial:
        baud = openings.baud or int(_common("baud", {link.name: link.baud for link in links}))
        if openings.pty:
            line = await serve_pty(bus, baud)
            servers.append(line)
            say(f"rtu {line.path} {baud} baud parity none")
        if openings.serial:
            parity = openings.parity or str(_common("parity", {link.name: link.parity for link in links}))
            stop_bits = int(_common("stop_bits", {link.name: link.stop_bits for link in links}))
            line = await serve_serial(bus, openings.serial, baud, parity, stop_bits=stop_bits)
            servers.append(line)
            say(f"rtu {line.path} {baud} baud parity {parity}")


def _common(key: str, values: Mapping[str, object]) -> Any:
    """The one value that all links agree on."""
    if len(set(values.values())) > 1:
        told = ", ".join(f"{link} {value}" for link, value in values.items())
        raise ConfigurationError(f"{key} differs ({told}): expected the same on all, or --link NAME")
    return next(iter(values.values()))
