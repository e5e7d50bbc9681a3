"""What is given to the disk, counted by the kernel."""

import os
from pathlib import Path

import pytest

from app.historian import written
from app.historian.written import DAY, Written


def test_a_rate_is_told_of_the_last_24_hours_and_not_before_a_minute() -> None:
    count = 0
    meter = Written(lambda: count)
    assert meter.per_day is None
    for minute in range(3 * 24 * 60):
        count += 1_000 if minute < 24 * 60 else 3_000
        meter.note(minute * 60.0)
        if minute == 0:
            assert meter.per_day is None
        elif minute < 24 * 60:
            assert meter.per_day == pytest.approx(1_000 * 24 * 60)
    assert meter.per_day == pytest.approx(3_000 * 24 * 60)
    assert len(meter._seen) <= DAY / 60 + 2


def test_where_nobody_counts_nothing_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for text in (None, "", "rchar: 1\n", "write_bytes: many\n"):
        file = tmp_path / "io"
        if text is not None:
            file.write_text(text)
        monkeypatch.setattr(written, "IO", file)
        meter = Written()
        meter.note(0.0)
        meter.note(600.0)
        assert meter.per_day is None


@pytest.mark.skipif(not Path("/proc/self/io").exists(), reason="counts what the kernel counts")
def test_what_is_written_is_counted(tmp_path: Path) -> None:
    before = written.of_this_process()
    assert before is not None
    with (tmp_path / "file").open("wb") as file:
        file.write(b"x" * 4_000_000)
        file.flush()
        os.fsync(file.fileno())
    after = written.of_this_process()
    assert after is not None
    if after == before:
        pytest.skip("the folder for tests lies in memory")
    assert after - before >= 4_000_000
