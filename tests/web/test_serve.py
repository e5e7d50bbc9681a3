"""What `pogon run` refuses before it opens a port, and what the server's log leaves out."""

import gc
import logging
from pathlib import Path

import pytest
import uvicorn
from fastapi import FastAPI

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


async def test_the_collector_is_off_while_it_starts_and_goes_afterwards(tmp_path: Path) -> None:
    settings = Settings(data=tmp_path, port=0)
    server = Server(uvicorn.Config(FastAPI(), port=0, lifespan="off"), FastAPI(), settings)
    server.config.load()
    server.lifespan = server.config.lifespan_class(server.config)
    gc.disable()
    try:
        await server.startup()
        assert gc.isenabled()
    finally:
        gc.enable()
        gc.unfreeze()
        await server.shutdown()
