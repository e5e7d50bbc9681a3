"""Names of hosts, and resolvers that are away."""

import asyncio
import socket
import threading
from collections.abc import Iterator

import pytest
import uvloop

from app.errors import NotConnected
from app.links.contract import Block
from app.links.names import addresses_of
from app.links.tcp import TcpTransport
from app.plant.definitions import Link
from app.sim.bus import Bus
from tests.conftest import find_port
from tests.links.devices import RegisterDevice, serving

pytestmark = pytest.mark.real_time

Found = list[tuple[int, int, int, str, tuple[str, int]]]


class Resolver:
    """Answers for names with what `known` says; while it is `away` whoever asks waits."""

    def __init__(self) -> None:
        self.known: dict[str, list[str]] = {}
        self.asked: list[str] = []
        self.here = threading.Event()
        self.here.set()

    def look_up(self, host: str, *_: object, **__: object) -> Found:
        self.asked.append(host)
        if not host.endswith(".near"):
            assert self.here.wait(30)
        if host not in self.known:
            raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (address, 0)) for address in self.known[host]]


@pytest.fixture
def resolver(monkeypatch: pytest.MonkeyPatch) -> Iterator[Resolver]:
    resolver = Resolver()
    monkeypatch.setattr(socket, "getaddrinfo", resolver.look_up)
    yield resolver
    resolver.here.set()


def test_names_that_nobody_answers_for_keep_no_other_link_out(resolver: Resolver) -> None:
    """uvloop, the loop of the server, has four threads for all names: two such links with two connections each took them for ever."""

    async def story() -> None:
        server = await serving(Bus({1: RegisterDevice({0: 7})}))
        resolver.known["plc.near"] = ["127.0.0.1"]
        resolver.here.clear()
        for _ in range(3):
            lost = [TcpTransport(Link("far", "tcp", host=f"plc{n}.far", tcp_port=502)) for n in range(6)]
            refused = await asyncio.gather(*(one.connect() for one in lost), return_exceptions=True)
            assert [type(one) for one in refused] == [NotConnected] * 6
            assert "no answer for this name in 1.2 s; is the name server there?" in str(refused[0])
        assert sorted(resolver.asked) == [f"plc{n}.far" for n in range(6)]  # one question for each, at a time
        near = TcpTransport(Link("hall", "tcp", host="plc.near", tcp_port=server.address[1]))
        await near.connect()
        assert await near.read(1, Block(0, 1), 5.0) == [7]
        await near.close()
        await server.close()

    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(story())


async def test_an_answer_that_comes_late_is_for_who_asks_next_and_then_it_is_asked_anew(resolver: Resolver) -> None:
    """A resolver that takes longer than a connection may never let one be made."""
    resolver.known["plc.far"] = ["192.0.2.1"]
    resolver.here.clear()
    for _ in range(2):
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(addresses_of("plc.far"), 0.05)
    resolver.here.set()
    assert await addresses_of("plc.far") == ("192.0.2.1",)
    assert resolver.asked == ["plc.far"]
    resolver.known["plc.far"] = ["192.0.2.2"]
    assert await addresses_of("plc.far") == ("192.0.2.2",)
    resolver.known.clear()
    with pytest.raises(socket.gaierror):
        await addresses_of("plc.far")


async def test_an_address_is_asked_of_nobody(resolver: Resolver) -> None:
    assert [await addresses_of(one) for one in ("192.0.2.1", "fe80::1")] == [("192.0.2.1",), ("fe80::1",)]
    assert not resolver.asked


async def test_each_address_of_a_name_is_tried(resolver: Resolver) -> None:
    server = await serving(Bus({1: RegisterDevice({0: 7})}))
    resolver.known["plc.near"] = ["127.0.0.2", "127.0.0.1"]
    transport = TcpTransport(Link("hall", "tcp", host="plc.near", tcp_port=server.address[1]))
    await transport.connect()
    assert await transport.read(1, Block(0, 1), 5.0) == [7]
    await transport.close()
    await server.close()
    gone = TcpTransport(Link("hall", "tcp", host="plc.near", tcp_port=find_port()))
    with pytest.raises(NotConnected, match="refused; is its Modbus server on"):
        await gone.connect()
