"""The journal of `pogon.db` is damaged while somebody works: Stop goes on, nobody is signed out, the audit is whole, all are told."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from tests.test_database_watch import alarms, cut_journal, noise_in_journal
from tests.web.operating import Operator, runtime_of, until
from tests.web.people import Staff


@pytest.fixture(scope="module")
def ana(demo: TestClient) -> Operator:
    return Operator(Staff(demo), "ana", ("admin", "engineer", "operator"))


@pytest.mark.parametrize("tail", ["-wal", "-shm"])
@pytest.mark.parametrize("fault", [cut_journal, noise_in_journal])
def test_stop_goes_on_and_who_is_signed_in_stays_so(
    demo: TestClient,
    ana: Operator,
    tail: str,
    fault: Callable[[Path], None],
    caplog: pytest.LogCaptureFixture,
) -> None:
    runtime = runtime_of(demo)
    gate = runtime.gate
    assert gate is not None
    assert demo.portal is not None

    def over() -> bool:
        return until(lambda: (last := gate.progress("m1")) is not None and last.over)

    ana.take("m1")
    assert ana.press("/equipment/m1/command/set_frequency", argument="38.5", expected="").status_code < 300
    assert over()
    demo.portal.call(asyncio.sleep, 2)  # who signed in within the last second has to do it again
    fault(runtime.db.path.with_name(f"pogon.db{tail}"))
    assert ana.press("/equipment/m1/stop").status_code < 300
    assert over()
    assert until(lambda: caplog.text.count("database lost file=pogon.db what=journal_damaged") == 1)
    assert alarms(runtime, "database_restored") or alarms(runtime, "database_shortened")
    ana.sit()
    assert demo.get("/audit").status_code == 200  # she still is who she was
    assert runtime.access.audit.healthy
    assert demo.portal.call(runtime.access.audit.check).ok
    assert ana.post("/equipment/m1/token/release").status_code == 200
