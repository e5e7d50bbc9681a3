"""A PLC server written from the pages alone keeps every rule that `pogon conform` knows: the pages say all that it asks for."""

import asyncio

import pytest

from app.links.conformance.finding import State
from tests.links.conformance.servers import KINDS, judged, rules_in
from tests.plc_pages.page import read_page
from tests.plc_pages.server import PagePlc


@pytest.mark.parametrize("kind", KINDS)
async def test_a_server_from_the_page_keeps_every_rule(kind: str) -> None:
    plc = PagePlc(read_page(kind))
    task = asyncio.create_task(plc.run())

    async def exchange(pdu: bytes) -> bytes:
        return plc.answer(pdu)

    for event in list(plc.page.events.values())[:4]:
        plc.tell(event)
    found = await judged(exchange, kind)
    task.cancel()
    assert not rules_in(found, State.BROKEN), [finding for finding in found.values() if finding.state is State.BROKEN]
    assert {found[rule].why for rule in rules_in(found, State.SKIPPED)} <= {"none", "nothing", "needs"}
    assert not plc.asked and not any(plc.held), "nothing was executed"
