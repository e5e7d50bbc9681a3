"""Tables about people: those that the migrations make, and what belongs to a person goes with the person."""

from pathlib import Path

import pytest
from sqlalchemy import ForeignKeyConstraint, Table

from app.access import tables
from app.db import pogon_tables
from tests.migrated import differences

ALL = [table for table in vars(tables).values() if isinstance(table, Table)]


def test_the_migrations_make_the_tables_that_the_program_knows(tmp_path: Path) -> None:
    assert len(ALL) > 3
    assert differences(tmp_path, *ALL) == []


def test_every_table_of_the_database_has_a_key() -> None:
    assert all(table.primary_key.columns for table in pogon_tables.sorted_tables)


@pytest.mark.parametrize("table", ALL, ids=lambda table: table.name)
def test_what_names_a_person_as_its_owner_is_deleted_with_the_person(table: Table) -> None:
    foreign = [one for one in table.constraints if isinstance(one, ForeignKeyConstraint)]
    assert all(one.ondelete == "CASCADE" and one.referred_table is tables.person_table for one in foreign)
