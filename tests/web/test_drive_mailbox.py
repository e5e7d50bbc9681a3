"""What pages keep of a drive: it belongs to the drive at its place, and a link that is not there is told."""

from collections.abc import Iterator
from dataclasses import replace

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.settings import Settings
from app.web.drive_mailbox import drive_among
from tests.virtual import house, pass_time
from tests.web.people import Staff

PATHS = ("/equipment/d1/drive-parameters", "/equipment/d1/fault-buffer")


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    settings = Settings(plant=bundled("plants/sinamics"), data=tmp_path_factory.mktemp("drives") / "data")
    with house(settings) as browser:
        staff = Staff(browser)
        staff.enter("ivana", "engineer", "operator")
        browser.cookies.set("pogon_lang", "en")
        pass_time(3)
        yield staff


def shown(client: TestClient, path: str) -> bool:
    """Whether something is known that was read."""
    text = client.get(f"{path}?group=ramp").text
    return "not read" not in text and "Not read yet" not in text


@pytest.mark.sweep(8)
@pytest.mark.parametrize("path", PATHS)
def test_of_another_drive_under_the_same_name_nothing_is_known(people: Staff, path: str) -> None:
    client, runtime = people.client, people.client.app.state.runtime  # type: ignore[attr-defined]
    assert people.post(f"{path}/read", {"group": "ramp"} if "drive" in path else {}).status_code in (200, 303)
    pass_time(20)
    assert shown(client, path)
    plant = runtime.plant
    item = plant.equipment["d1"]
    try:
        other = replace(item, unit=2)
        runtime.plant = replace(plant, equipment={**plant.equipment, "d1": other})
        assert not shown(client, path)
    finally:
        runtime.plant = plant
    assert shown(client, path)


@pytest.mark.parametrize("path", PATHS)
def test_without_its_link_the_drive_is_not_to_be_read(people: Staff, path: str) -> None:
    runtime = people.client.app.state.runtime  # type: ignore[attr-defined]
    link = runtime.links.pop("drives")
    try:
        answer = people.post(f"{path}/read", {})
    finally:
        runtime.links["drives"] = link
    assert answer.status_code == 503 and "The link of this machine is not running" in answer.text


def test_the_drive_is_the_first_object_beside_the_control_unit() -> None:
    assert [drive_among(objects) for objects in ((), (1,), (1, 2), (3, 1, 4))] == [1, 1, 2, 3]
