"""What `pogon run` refuses before it opens a port, and what the server's log leaves out."""

import logging
from pathlib import Path

import pytest

from app.errors import ConfigurationError
from app.web.serve import check_key, without_query


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
