"""A proxy that has the TLS: what nginx or Caddy do before the house, as far as a browser sees it."""

import asyncio
import ssl
import threading
from types import TracebackType

HEAD = b"\r\n\r\n"


class Proxy:
    """Takes https on `port`, asks the house on `house` and says for whom. It lives in a thread of its own."""

    def __init__(self, house: int, port: int, context: ssl.SSLContext) -> None:
        self.url = f"https://localhost:{port}"
        self._house, self._port, self._context = house, port, context
        self._loop = asyncio.new_event_loop()
        self._opened, self._over = threading.Event(), asyncio.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> "Proxy":
        self._thread.start()
        assert self._opened.wait(30), "the proxy did not open"
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._loop.call_soon_threadsafe(self._over.set)
        self._thread.join(30)

    def _serve(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:  # whoever is still talked to then is cancelled
            runner.run(self._open())

    async def _open(self) -> None:
        async with await asyncio.start_server(self._take, "127.0.0.1", self._port, ssl=self._context) as server:
            self._opened.set()
            await self._over.wait()
            server.close()
            for task in asyncio.all_tasks() - {asyncio.current_task()}:
                task.cancel()
            await asyncio.sleep(0.1)

    async def _take(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            asked, asks = await asyncio.open_connection("127.0.0.1", self._house)
        except OSError:
            writer.close()
            return
        back = asyncio.ensure_future(_pass(asked, writer))
        try:
            while True:
                head = await reader.readuntil(HEAD)
                lines = head[: -len(HEAD)].split(b"\r\n")
                told = [line for line in lines if not line.lower().startswith(b"x-forwarded-")]
                told += [b"X-Forwarded-For: 127.0.0.1", b"X-Forwarded-Proto: https"]
                asks.write(b"\r\n".join(told) + HEAD)
                named = {
                    key.strip().lower(): value.strip() for key, _, value in (line.partition(b":") for line in lines[1:])
                }
                if named.get(b"upgrade"):
                    await _pass(reader, asks)
                    return
                asks.write(await reader.readexactly(int(named.get(b"content-length", b"0"))))
                await asks.drain()
        except (OSError, asyncio.IncompleteReadError, asyncio.CancelledError):
            pass  # the browser has gone, or the test is over
        finally:
            back.cancel()
            asks.close()
            writer.close()


async def _pass(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """What one says the other hears, to the end."""
    try:
        while said := await reader.read(1 << 16):
            writer.write(said)
            await writer.drain()
    except OSError:
        pass
    finally:
        writer.close()
