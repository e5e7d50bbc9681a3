"""What a person does keeps what the person holds; what is slow at the start harms no task."""

import asyncio
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.plant.retained import RetainedStates
from tests.virtual import pass_time
from tests.web.conftest import Start
from tests.web.people import Staff


def holder(client: TestClient) -> str:
    held = client.app.state.runtime.gate.control.holder("m1")  # type: ignore[attr-defined]
    return held.display if held else ""


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("pages", "kept"), [(True, True), (False, False)])
def test_who_works_on_the_pages_keeps_control_without_a_command(
    start: Start, monkeypatch: pytest.MonkeyPatch, pages: bool, kept: bool
) -> None:
    monkeypatch.setattr("app.commands.control_token.IDLE", 8.0)
    client = start()
    staff = Staff(client)
    staff.enter("ivo", "operator")
    assert staff.post("/equipment/m1/token/take").status_code in (200, 204, 303)
    session = client.app.state.runtime.gate.control  # type: ignore[attr-defined]
    session.socket_opened(session.holder("m1").session)
    for _ in range(4):
        pass_time(3)
        if pages:
            assert client.get("/equipment/m1", headers={"Accept": "text/html"}).status_code == 200
    assert bool(holder(client)) is kept


@pytest.mark.sweep(8)
def test_a_slow_database_at_the_start_makes_no_task_fail(start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    read = RetainedStates.read

    async def slow(self: RetainedStates) -> Any:
        await asyncio.sleep(2)
        return await read(self)

    monkeypatch.setattr(RetainedStates, "read", slow)
    client = start()
    pass_time(1)
    kept = client.app.state.runtime.supervisor.tasks  # type: ignore[attr-defined]
    assert not [task.name for task in kept.values() if task.failures]
