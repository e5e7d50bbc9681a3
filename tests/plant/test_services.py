"""Services of a unit are read by the name of their table."""

from pathlib import Path

import pytest

from app.plant import services, types
from app.plant.definitions import PlcMap
from app.plant.plant_files.languages import LANGUAGES


@pytest.mark.parametrize("name", types.names())
def test_a_type_has_the_services_whose_tables_it_has_and_no_kind_twice(name: str) -> None:
    data, problems = types.read_type(name, LANGUAGES)
    assert problems == []
    text = (Path("app/equipment") / name / "device.toml").read_text()
    tables = [table for table in services.READERS if f"\n[{table}]\n" in text]
    kinds = [type(service) for service in data.type.device.services]
    assert len(kinds) == len(tables) == len(set(kinds))
    assert (PlcMap in kinds) is ("plc" in tables)
