"""The check that time and chance come from the house knows their names however they are imported."""

import ast

import pytest

from tools import check_purity


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("import time\ntime.monotonic()", "time.monotonic"),
        ("import time as t\nt.sleep(1)", "time.sleep"),
        ("from time import time as now\nnow()", "time.time"),
        ("from time import perf_counter\nclock = perf_counter", "time.perf_counter"),
        ("from datetime import datetime\ndatetime.now()", "datetime.now"),
        ("import datetime\ndatetime.datetime.now()", "datetime.now"),
        ("import datetime as d\nd.date.today()", "date.today"),
        ("import random\nrandom.random()", "random.random"),
        ("from random import choice\nchoice([1])", "random.choice"),
        ("from random import Random\nRandom()", "random.Random"),
        ("import secrets\nsecrets.token_hex()", "secrets.token_hex"),
        ("from uuid import uuid4\nuuid4()", "uuid.uuid4"),
        ("import os\nos.urandom(4)", "os.urandom"),
        ("from random import Random\nRandom(7).random()", ""),
        ("import secrets\nsecrets.compare_digest('a', 'b')", ""),
        ("import time\ntime.process_time()", ""),
        ("from datetime import datetime\ndatetime(2026, 3, 9)", ""),
        ("import asyncio\nasyncio.sleep(1)", ""),
    ],
)
def test_what_asks_the_machine_is_found(source: str, found: str, tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "app").mkdir()
    (tmp_path / "app" / "some.py").write_text(source)
    monkeypatch.setattr(check_purity, "ROOT", tmp_path)
    told = list(check_purity.impure_times("app", ()))
    assert [line.split(": ")[1].split(",")[0] for line in told] == ([found] if found else [])
    assert list(check_purity.impure_times("app", ("app/some.py",))) == []


@pytest.mark.parametrize(
    ("source", "excused"),
    [
        ("import time\ndef test_a():\n    time.sleep(1)\n", False),
        ("import pytest, time\n@pytest.mark.real_time\ndef test_a():\n    time.sleep(1)\n", True),
        ("import pytest, time\npytestmark = pytest.mark.browser\ndef test_a():\n    time.sleep(1)\n", True),
        ("import pytest, time\n@pytest.mark.slow\ndef test_a():\n    time.sleep(1)\n", False),
        ("import pytest, time\n@pytest.mark.real_time\ndef test_a(): ...\ndef test_b():\n    time.sleep(1)\n", False),
    ],
)
def test_a_test_is_excused_by_its_mark_only(source: str, excused: bool) -> None:
    tree = ast.parse(source)
    assert (tree.body[-1] in check_purity.real_parts(tree)) is excused
