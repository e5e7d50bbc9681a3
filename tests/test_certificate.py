"""A certificate that ends is told while the server runs."""

from pathlib import Path

import pytest

from app.certificate import end_if_known, end_of
from app.clock import ManualClock
from app.runtime import Runtime
from app.settings import Settings
from tests.test_cli import self_signed
from tests.virtual import inline

DAY = 86400.0


@pytest.mark.real_time
async def test_the_certificate_that_the_server_uses_is_an_alarm_in_words_until_it_is_another_one(
    tmp_path: Path,
) -> None:
    cert, key = self_signed(tmp_path)
    end, clock = end_of(cert), ManualClock()
    clock.step_wall(end - 20 * DAY - clock.micros() / 1e6)
    runtime = Runtime(
        Settings(plant=tmp_path / "no-plant", data=tmp_path / "data", tls_cert=cert, tls_key=key), clock, inline
    )
    await runtime.start()
    try:
        runtime.sweep.publish()
        assert not [one for one in runtime.alarms.list.active() if one.key == "certificate_ends"]
        clock.step_wall(10 * DAY)
        runtime.sweep.publish()
        (one,) = [one for one in runtime.alarms.list.active() if one.key == "certificate_ends"]
        assert str(dict(one.params)["time"]).count("-") == 2
    finally:
        await runtime.stop()


@pytest.mark.parametrize("content", [None, "", "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n"])
def test_of_what_is_no_certificate_nobody_can_tell(tmp_path: Path, content: str | None) -> None:
    path = tmp_path / "cert.pem"
    if content is not None:
        path.write_text(content)
    assert end_if_known(path) is None and end_if_known(None) is None
