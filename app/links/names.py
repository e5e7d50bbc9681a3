"""Addresses of the hosts that links call by name.

A resolver that is away keeps whoever asks it for many seconds. The loop's own look-up does so in a few threads that the whole process
shares, and whoever had given up asked again behind his former question: two names that nobody answered for kept every other link
with a name out, for as long as that lasted. So each name has a thread of its own here and one question at a time, and an answer that comes
when its caller has gone is for the next one.
"""

import asyncio
import contextlib
import ipaddress
import socket
import threading
from concurrent.futures import Future
from dataclasses import dataclass, field

from app.links.line import finish

KEPT = 60.0
"""An answer for which nobody waited is for who asks within so long of its question [s]."""


@dataclass(slots=True)
class _Question:
    asked: float
    """By the clock of the loop [s]."""
    answer: Future[tuple[str, ...]] = field(default_factory=Future)


_questions: dict[str, _Question] = {}


async def addresses_of(host: str) -> tuple[str, ...]:
    """The IP addresses of `host`, the one to be tried first at the head; of an address that one. Who has waited long enough may leave.

    Raises:
        OSError: nobody knows the name, or the resolver says that it cannot tell.
    """
    if _is_address(host):
        return (host,)
    loop = asyncio.get_running_loop()
    question = _questions.get(host)
    if question is None or (question.answer.done() and loop.time() - question.asked > KEPT):
        question = _questions[host] = _Question(loop.time())
        threading.Thread(target=_look_up, args=(host, question.answer), name=f"name {host}", daemon=True).start()
    told: asyncio.Future[None] = loop.create_future()

    def tell(_: Future[tuple[str, ...]]) -> None:
        with contextlib.suppress(RuntimeError):  # the loop may be gone
            loop.call_soon_threadsafe(finish, told)

    question.answer.add_done_callback(tell)
    await told
    if _questions.get(host) is question:
        del _questions[host]
    return question.answer.result()


def _look_up(host: str, answer: Future[tuple[str, ...]]) -> None:
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
        answer.set_result(tuple(dict.fromkeys(str(one[4][0]) for one in found)))
    except Exception as error:
        answer.set_exception(error)


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True
