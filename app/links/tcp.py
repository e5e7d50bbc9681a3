"""Modbus TCP through pymodbus: its socket, its transaction numbers, its one request at a time; our PDUs and our checks.

pymodbus 3.16 decodes an answer without checking function, count or echo, takes 125 registers apart one by one, and closes the socket
from inside its callback when an answer is nonsense (reference/modbus.md section 5). Therefore its framer hands over the PDU as it came,
and `registers.pdu.parse_answer` decides.
"""

import asyncio
import errno
import logging
import socket
from collections.abc import Sequence
from typing import cast

from pymodbus.client import AsyncModbusTcpClient
from pymodbus.exceptions import ConnectionException, ModbusIOException
from pymodbus.framer.socket import FramerSocket
from pymodbus.pdu import DecodePDU, ModbusPDU

from app import chance
from app.addresses import as_written
from app.errors import BadAnswer, NoAnswer, NotConnected
from app.links.contract import Block, Counts, Exchange
from app.links.names import addresses_of
from app.links.patience import Patience
from app.plant.definitions import Link
from app.registers.pdu import Request, build_request, parse_answer

CONNECT_LIMIT = 1.2
"""Longest wait for a socket [s]."""
TRANSACTIONS = 65000
"""pymodbus begins again behind that number."""
LONGEST = 254
"""Of what the head of an answer may announce: a unit and a PDU [bytes]."""
LARGEST = 1 << 16
"""Of what came and was not understood yet [bytes]. pymodbus throws all of it away above 264, also the answer, when others came before."""
NAMELESS = f"no answer for this name in {CONNECT_LIMIT:g} s; is the name server there? An address needs none"
NEVER = 1 << 40
"""pymodbus would cut the line after a few silent units; the link decides that."""
REASONS: dict[int, str] = {
    errno.ECONNREFUSED: "refused; is its Modbus server on, and the port right?",
    errno.EHOSTUNREACH: "nobody at this address; is it switched on, and the cable in?",
    errno.ENETUNREACH: "no way to this address; is this computer in its network?",
}
"""What helps, by error number of the system."""

# Silence and refusals are counted, shown and told once by the link; pymodbus would tell every one of them as an error.
logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)


class TcpTransport:
    """One socket to a device or gateway."""

    parallel = True

    def __init__(self, link: Link, exchange: Exchange | None = None) -> None:
        """`exchange` is of the memory transport; not used here."""
        self.counts = Counts()
        self._where = as_written(link.host, link.tcp_port)
        self._host, self._port = link.host, link.tcp_port
        self._client: AsyncModbusTcpClient | None = None
        self._transaction = chance.randrange(0, TRANSACTIONS)
        """Number of the last request: a gateway may hand an answer to a former connection, or to another one, to the next that comes."""
        self._asking = False

    @property
    def connected(self) -> bool:
        """Whether the socket is open, as far as anybody knows."""
        return self._client is not None and _is_open(self._client)

    async def connect(self) -> None:
        """Open the socket."""
        await self.close()
        client = AsyncModbusTcpClient(
            self._host,
            port=self._port,
            retries=0,
            reconnect_delay=0,
            timeout=CONNECT_LIMIT,
            trace_connect=self._connection_changed,
        )
        client.set_max_no_responses(NEVER)
        client.ctx.framer = _PlainFramer(DecodePDU(False))
        client.ctx.max_buffer_size = LARGEST
        why = ""

        async def call() -> object:
            """pymodbus keeps to itself why it could not connect."""
            nonlocal why
            try:
                why = NAMELESS
                addresses = await addresses_of(self._host)
                why = f"no answer in {CONNECT_LIMIT:g} s"
                return await _call(client, addresses, self._port)
            except OSError as error:
                why = _reason_of(error)
                raise

        client.ctx.call_create = call
        try:
            opened = await client.connect()
        except BaseException:
            client.close()
            raise
        if not opened:
            client.close()
            _raise_if_cancelled()
            raise NotConnected(f"{self._where}: no connection, {why}")
        if not _is_open(client):  # closed before pymodbus could hear of it, and it will not hear of it again
            client.close()
            raise NotConnected(f"{self._where}: closed by the other end")
        client.ctx.next_tid = self._transaction
        self._client = client

    async def read(self, unit: int, block: Block, patience: float) -> list[int]:
        """Exactly `block.count` words."""
        return await self._ask(unit, Request(block.function, block.address, block.count), patience)

    async def write(self, unit: int, address: int, words: Sequence[int], patience: float, function: int = 6) -> None:
        """Write `words`; returns when the echo equals the request."""
        await self._ask(unit, Request(function, write_address=address, words=tuple(words)), patience)

    async def exchange(self, unit: int, pdu: bytes, patience: float) -> bytes:
        """The answer to `pdu` as it came, whatever either says: for who examines a device.

        Raises:
            NoAnswer, NotConnected: as `read`.
        """
        client = self._client
        if client is None or not _is_open(client):
            raise NotConnected(f"{self._where}: not connected")
        return await self._carry(client, _Telegram(unit, pdu), patience)

    async def close(self) -> None:
        """Close the socket."""
        client, self._client = self._client, None
        if client is not None:
            self._transaction = client.ctx.next_tid
            client.close()

    async def _ask(self, unit: int, request: Request, patience: float) -> list[int]:
        client = self._client
        if client is None or not _is_open(client):
            raise NotConnected(f"{self._where}: not connected")
        try:
            telegram = _Telegram(unit, build_request(request))
        except ValueError as error:
            raise BadAnswer(f"unit {unit}: {error}") from error
        return parse_answer(request, await self._carry(client, telegram, patience))

    async def _carry(self, client: AsyncModbusTcpClient, telegram: "_Telegram", patience: float) -> bytes:
        client.ctx.comm_params.timeout_connect = 4 * patience  # never comes: ours does
        self._asking = True
        framer = cast(_PlainFramer, client.ctx.framer)
        framer.strange = None
        try:
            async with Patience(patience):
                answer = await client.ctx.execute(False, telegram)
        except (TimeoutError, ModbusIOException) as error:
            _raise_if_cancelled()
            came = f"; {framer.came}" if framer.came else ""
            silence = NoAnswer(f"{self._where} unit {telegram.dev_id}: no answer in {patience:g} s{came}")
            silence.instead = framer.came
            raise silence from error
        except (ConnectionException, OSError) as error:
            _raise_if_cancelled()
            raise NotConnected(f"{self._where}: connection lost") from error
        except RuntimeError as error:  # of uvloop, which lets nobody write to a socket that is closed
            if _is_open(client):
                raise
            raise NotConnected(f"{self._where}: connection lost") from error
        finally:
            self._asking = False
        _raise_if_cancelled()
        if not isinstance(answer, _Telegram):
            raise BadAnswer(f"{self._where} unit {telegram.dev_id}: {answer!r}, expected an answer")
        return answer.pdu

    def _connection_changed(self, connected: bool) -> None:
        """pymodbus lets a request wait for its time-out when the socket goes; nobody should."""
        if connected or not self._asking or self._client is None:
            return
        waiting: asyncio.Future[ModbusPDU] = self._client.ctx.response_future
        if not waiting.done():
            waiting.set_exception(ConnectionException(f"{self._where}: closed by the other end"))


async def _call(client: AsyncModbusTcpClient, addresses: Sequence[str], port: int) -> object:
    """A socket to the first of `addresses` that takes one."""
    loop = asyncio.get_running_loop()
    for more in range(len(addresses) - 1, -1, -1):
        try:
            return await loop.create_connection(client.ctx.handle_new_connection, addresses[-1 - more], port)
        except OSError:
            if not more:
                raise
    raise OSError("its name has no address")


def _reason_of(error: OSError) -> str:
    """What is wrong and what helps, as of a serial port."""
    if isinstance(error, socket.gaierror):
        return f"nobody knows this name ({error.strerror})"
    if error.errno is None:
        return str(error)
    return f"{REASONS.get(error.errno) or error.strerror} ({errno.errorcode.get(error.errno, error.errno)})"


def _is_open(client: AsyncModbusTcpClient) -> bool:
    """Whether its socket is: pymodbus believes in one that was lost while it was being opened."""
    transport: asyncio.BaseTransport | None = client.ctx.transport
    return client.connected and transport is not None and not transport.is_closing()


def _raise_if_cancelled() -> None:
    """wait_for of Python 3.11, which pymodbus uses, forgets a cancellation that comes together with an answer or an error.

    Raises:
        CancelledError: this task is to end.
    """
    task = asyncio.current_task()
    if task is not None and task.cancelling():
        raise asyncio.CancelledError


class _Telegram(ModbusPDU):
    """A PDU as bytes."""

    def __init__(self, unit: int, pdu: bytes) -> None:
        self.dev_id = unit
        self.transaction_id = 0
        self.retries = 0
        self.pdu = pdu
        self.function_code = pdu[0] if pdu else 0

    def encode(self) -> bytes:
        """All behind the function code."""
        return self.pdu[1:]


class _PlainFramer(FramerSocket):
    """Finds the answer to the request on its way by transaction and unit, and leaves its meaning to others."""

    strange: int | None = None
    """The unit that the last answer to a transaction named in place of the one that was asked."""
    nonsense: bytes = b""
    """The beginning of what came since the last answer and was no Modbus TCP."""

    @property
    def came(self) -> str:
        """What came in place of an answer, in words."""
        if self.strange is not None:
            return f"answers came with unit {self.strange}: is that its unit?"
        if self.nonsense:
            shown = self.nonsense.hex(" ")
            return f"bytes came that are no Modbus TCP ({shown}): is the port right, and does the gateway speak Modbus TCP?"
        return ""

    def handleFrame(self, data: bytes, exp_devid: int, exp_tid: int) -> tuple[int, ModbusPDU | None]:
        """Bytes used, and the first answer to `exp_tid` of `exp_devid`; strangers are skipped."""
        used = 0
        while used < len(data):
            if not _begins_answer(data[used : used + 6]):  # nobody can tell where the next one begins
                self.nonsense = self.nonsense or data[used : used + 8]
                return len(data), None
            length, unit, transaction, pdu = self.decode(data[used:])
            used += length
            if not length:
                return used, None
            if transaction == exp_tid and unit == exp_devid and pdu:
                self.nonsense = b""
                telegram = _Telegram(unit, pdu)
                telegram.transaction_id = transaction
                return used, telegram
            if transaction == exp_tid and pdu:
                self.strange = unit
        return used, None


def _begins_answer(head: bytes) -> bool:
    """Whether an answer may begin so: the protocol is 0, and what is announced is a unit and a function at least."""
    return head[2:4] in (b"\0\0", b"\0", b"") and (len(head) < 6 or 2 <= int.from_bytes(head[4:6], "big") <= LONGEST)
