"""Tables of a device as rows: who has an id has a row, in the order of a column, and nobody's row is not drawn."""

from functools import partial

import pytest

from app.clock import ManualClock
from app.plant.loader import read_plant
from app.plant.texts import Texts
from app.tags.batch import Batch, Value
from app.tags.database import Tag, TagDatabase
from app.tags.quality import COMM_FAILURE, GOOD
from app.web.points import EquipmentView
from app.web.tables import TableView, tables_of
from tests.conftest import ROOT

PLANT, _ = read_plant(ROOT / "plants" / "demo")
assert PLANT is not None
TEXTS = Texts.read(PLANT)


class Line:
    """The demo's conveyor with what a test publishes."""

    plant = PLANT

    def __init__(self) -> None:
        assert PLANT is not None
        self.clock = ManualClock()
        self.tags = TagDatabase(self.clock)
        item = PLANT.equipment["c1"]
        self.tags.configure([Tag(point.name, point.name, "link.line") for point in item.points.values()])
        self.view = EquipmentView(item, self, "en", partial(TEXTS.text, "en"))  # type: ignore[arg-type]

    def put(self, quality: int = GOOD, **values: Value) -> TableView:
        now = self.clock.micros()
        handles = [self.tags.handle(f"c1.product_{key}") for key in values]
        self.tags.publish(Batch("link.line", 0, now, now, handles, list(values.values()), quality))
        self.view._drawn.clear()
        return tables_of(self.view)["product"]


@pytest.fixture
def line() -> Line:
    return Line()


def test_only_a_slot_with_an_id_is_a_row(line: Line) -> None:
    assert line.put().rows == [] and not line.put().known
    table = line.put(**{"1_id": 7, "2_id": 0, "3_id": 9})
    assert [(row.slot, row.id) for row in table.rows] == [(1, 7), (3, 9)] and table.known
    found = table.row(9)
    assert found is not None and found.slot == 3 and table.row(0) is None and table.row(8) is None


def test_a_row_without_communication_is_none(line: Line) -> None:
    line.put(**{"1_id": 7})
    table = line.put(COMM_FAILURE, **{"1_id": 7})
    assert table.rows == [] and not table.known


def test_rows_are_ordered_by_a_column_and_those_without_a_value_come_last(line: Line) -> None:
    table = line.put(**{"1_id": 1, "2_id": 2, "3_id": 3, "1_head": 500.0, "3_head": 200.0})
    assert [row.id for row in table.by("head")] == [3, 1, 2]
    assert table.rows[1].number("head") is None and table.rows[0].number("nothing") is None
    assert table.rows[0].has("head") and table.rows[0]["head"].value == 500.0


def test_the_tags_of_its_cells_are_those_of_the_plant(line: Line) -> None:
    table = line.put()
    assert all(name in line.tags for slot in table.slots for name in table.names(slot, *table.columns).split())
    assert table.names(1, "id", "nothing") == "c1.product_1_id"
    assert len(table.watched.split()) == 1 + 2 * len(table.slots)
