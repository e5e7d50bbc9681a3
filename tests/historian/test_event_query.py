"""What lists have in common: counts that end, and the next page."""

import pytest
from sqlalchemy import Column, Integer, MetaData, String, Table, create_engine, insert, select

from app.historian.event_query import comes_after, counted

things = Table(
    "things", MetaData(), Column("id", Integer, primary_key=True), Column("time", Integer), Column("name", String)
)


@pytest.mark.parametrize(("most", "count"), [(100, 40), (40, 40), (39, 39), (1, 1), (0, 0)])
def test_it_counts_up_to_a_limit(most: int, count: int) -> None:
    engine = create_engine("sqlite://")
    with engine.connect() as connection:
        things.create(connection)
        connection.execute(insert(things), [{"time": n % 2, "name": "'; DROP TABLE things; --"} for n in range(80)])
        assert (
            counted(connection, things, [things.c.time == 1, things.c.name == "'; DROP TABLE things; --"], most)
            == count
        )
    engine.dispose()


def test_the_next_page_begins_after_the_last_row_of_the_same_time() -> None:
    engine = create_engine("sqlite://")
    with engine.connect() as connection:
        things.create(connection)
        connection.execute(insert(things), [{"time": n // 3} for n in range(9)])
        after = select(things.c.id).where(comes_after(things.c.time, things.c.id, (1, 5)))
        assert connection.execute(after).scalars().all() == [1, 2, 3, 4]
    engine.dispose()
