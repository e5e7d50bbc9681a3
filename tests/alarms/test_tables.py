"""Tables about alarms are those that the migrations make."""

from pathlib import Path

import pytest
from sqlalchemy import Table

from app.alarms import tables
from tests.migrated import differences

ALL = [table for table in vars(tables).values() if isinstance(table, Table)]


@pytest.mark.sweep(8)
def test_the_migrations_make_the_tables_that_the_program_knows(tmp_path: Path) -> None:
    assert {table.name for table in ALL} >= {"alarm_state", "alarm_journal"}
    assert differences(tmp_path, *ALL) == []
