"""Records of a plant that runs: from what its machines tell to list, detail, interface and file, each told the same."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from app.settings import Settings
from tests.demo_plant import plant_folder
from tests.test_cli_history import pogon
from tests.virtual import house
from tests.web.operating import runtime_of
from tests.web.people import Staff

SEEN = {"passage": "unloaded", "run": "done", "coil": "laid"}
"""Kind → outcome of what has ended within the time of the story."""
MACHINES = {"passage": "c1", "run": "seq1", "coil": "cc1"}
STORY = 150.0
"""[s]; the coil car of the demo plant takes its first coil after some 90 s."""


class Kept(NamedTuple):
    """What was seen of a kind while the plant ran."""

    records: list[dict[str, Any]]
    page: str
    detail: str
    csv: str


@pytest.fixture(scope="module")
def story(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, dict[str, Kept]]]:
    """The demo plant for a while, as a person and a program see its records; and its data when it has stopped."""
    folder = tmp_path_factory.mktemp("story")
    plant, data, found = plant_folder(folder / "plant", *MACHINES.values()), folder / "data", {}
    with house(Settings(plant=plant, data=data)) as client:
        staff = Staff(client)
        runtime = runtime_of(client)
        client.pass_time(STORY)
        for machine in MACHINES.values():
            assert runtime.tags.value(runtime.tags.handle(f"sys.events.{machine}")), "who looks is told"
        staff.enter("ana", "viewer")
        client.cookies.set("pogon_lang", "en")
        for kind, outcome in SEEN.items():
            records = client.get(f"/api/v1/records/{kind}", params={"outcome": outcome, "events": "true"}).json()[
                "records"
            ]
            page = client.get(f"/records/{kind}", params={"outcome": outcome}).text
            detail = client.get(f"/records/{kind}/detail/{records[-1]['id']}").text if records else ""
            csv = client.get(f"/records/{kind}/export.csv", params={"outcome": outcome, "locale": "machine"}).text
            found[kind] = Kept(records, page, detail, csv)
    yield data, found


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", SEEN)
def test_what_machines_did_is_in_records(story: tuple[Path, dict[str, Kept]], kind: str) -> None:
    records, page, detail, csv = story[1][kind]
    assert records, f"no {kind} has ended within {STORY} s"
    assert {one["equipment"] for one in records} == {MACHINES[kind]}
    assert {one["events_lost"] for one in records} == {0}
    assert [int(number) for number in re.findall(r'<tr data-row="(\d+)"', page)] == [one["id"] for one in records]
    assert f'data-tag="sys.events.{MACHINES[kind]}"' in page, "the page is told of the next one"
    assert 'class="p-facts"' in detail and f'href="/equipment/{MACHINES[kind]}"' in detail
    rows = [line for line in csv.splitlines() if not line.startswith("#")]
    assert len(rows) == 1 + len(records)
    assert all(f",{MACHINES[kind]}," in row for row in rows[1:])


def test_a_product_has_length_and_its_way_from_sensor_to_sensor(story: tuple[Path, dict[str, Kept]]) -> None:
    one = story[1]["passage"].records[-1]
    told = [event["event"] for event in one["events"]]
    assert (told[0], told[-1]) == ("arrived", "unloaded") and "head" in told
    assert one["begin_seen"] and one["fields"]["length"] > 0 and one["fields"]["corrections"] > 0


def test_a_run_has_its_steps_and_run_time(story: tuple[Path, dict[str, Kept]]) -> None:
    one = story[1]["run"].records[-1]
    assert [part["state"] for part in one["parts"]] == ["done"] * len(one["parts"]) and len(one["parts"]) > 3
    assert one["seconds"] == pytest.approx(sum(part["seconds"] for part in one["parts"]), abs=1.0)
    assert one["events"][-1]["event"] == "done" and one["fields"]["step"] == len(one["parts"])


@pytest.mark.sweep(8)
def test_a_coil_has_its_diameter_and_its_saddle(story: tuple[Path, dict[str, Kept]]) -> None:
    one = story[1]["coil"].records[-1]
    assert one["fields"]["diameter"] > 0 and one["fields"]["taken"] is not None
    assert one["events"][-1]["event"] == "coil_laid"


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", SEEN)
def test_the_command_line_gives_the_same_file(story: tuple[Path, dict[str, Kept]], kind: str) -> None:
    data, found = story
    begin = min(one["begun"] for one in found[kind].records)
    done = pogon(data, "export", "--records", f"{kind}:{MACHINES[kind]}", "--from", begin, "--to", "now", "--bom")
    assert done.returncode == 0, done.stderr
    told = [line for line in done.stdout.splitlines() if not line.lstrip("\ufeff").startswith("#")]
    seen = [line for line in found[kind].csv.splitlines() if not line.startswith("#")]
    assert told[0] == seen[0]
    assert set(seen) <= set(told), "those that have ended, beside those that are under way"
    assert done.stdout.splitlines()[-1].startswith("# sha256: ")
