"""What `pogon run` refuses before it opens a port, and what the server's log leaves out."""

import gc
import logging
from collections.abc import Iterator
from pathlib import Path

import pytest
import uvicorn
from fastapi import FastAPI
from typer.testing import CliRunner

from app.cli import cli
from app.errors import ConfigurationError
from app.settings import Settings
from app.web.serve import Server, check_key, without_query


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o644, 0o660, 0o620, 0o666, 0o777])
def test_a_key_that_others_may_use_is_refused_in_one_line(tmp_path: Path, mode: int) -> None:
    key = tmp_path / "key.pem"
    key.touch()
    key.chmod(mode)
    with pytest.raises(ConfigurationError) as refused:
        check_key(key)
    assert (
        str(refused.value)
        == f"POGON_TLS_KEY={key}: its mode {mode:04o} lets others use it, expected 0600 (chmod 600 {key})"
    )


@pytest.mark.parametrize("mode", [0o600, 0o400, 0o700])
def test_a_key_of_its_owner_is_taken(tmp_path: Path, mode: int) -> None:
    key = tmp_path / "key.pem"
    key.touch()
    key.chmod(mode)
    check_key(key)
    check_key(None)
    check_key(tmp_path / "none.pem")


@pytest.mark.parametrize(
    ("args", "written"),
    [
        (("127.0.0.1:1", "GET", "/audit?person=Ana%20K", "1.1", 200), "127.0.0.1:1 GET /audit 1.1 200"),
        (("127.0.0.1:1", "GET", "/a??b=1?c", "1.1", 200), "127.0.0.1:1 GET /a 1.1 200"),
        (("127.0.0.1:1", "GET", "/", "1.1", 303), "127.0.0.1:1 GET / 1.1 303"),
    ],
)
def test_the_log_has_no_query(args: tuple[object, ...], written: str) -> None:
    record = logging.LogRecord("uvicorn.access", logging.INFO, "", 0, "%s %s %s %s %d", args, None)
    assert without_query(record)
    assert record.getMessage() == written


@pytest.fixture
def collector() -> Iterator[None]:
    """It works before the test and after it, and walks what it walked."""
    assert gc.isenabled()
    frozen = gc.get_freeze_count()
    yield
    gc.enable()
    if not frozen:
        gc.unfreeze()


@pytest.mark.sweep(8)
@pytest.mark.usefixtures("collector")
@pytest.mark.parametrize("fails", [False, True])
def test_a_plant_starts_without_the_collector_and_whatever_comes_of_it_the_collector_works_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: bool
) -> None:
    found = list[bool]()

    def serve(_app: FastAPI, _settings: Settings) -> None:
        found.append(gc.isenabled())
        if fails:
            raise ConfigurationError("no port")

    monkeypatch.setattr("app.web.serve.serve", serve)
    monkeypatch.setattr("os.umask", lambda mask: mask)
    done = CliRunner().invoke(cli, ["run"], env={"POGON_DATA": str(tmp_path / "data")})
    assert (done.exit_code, found) == (2 if fails else 0, [False])
    assert gc.isenabled()


@pytest.mark.sweep(8)
@pytest.mark.usefixtures("collector")
async def test_the_collector_works_as_soon_as_the_port_is_open(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    async def opened(_self: uvicorn.Server, sockets: object = None) -> None:
        assert not gc.isenabled()

    monkeypatch.setattr(uvicorn.Server, "startup", opened)
    app = FastAPI()
    gc.disable()
    await Server(uvicorn.Config(app), app, Settings(data=tmp_path)).startup()
    assert gc.isenabled()
