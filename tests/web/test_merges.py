"""Merging gates of a PLC behind Modbus TCP: commanded and read back, records of where products came from, alarms; an older map has none."""

import re
from pathlib import Path

import pytest

from app.registers import plc_map
from app.sim import training
from app.sim.conveyor import training as own
from app.sim.conveyor.lanes import MERGE_FAULTS, MergePlan, Mode
from app.sim.conveyor.machine import Geometry
from app.sim.conveyor.program import VirtualConveyor
from tests.sim.conveyor.bench import QUICK
from tests.virtual import until
from tests.web.operating import line_of
from tests.web.test_gates import PLANT, hall

JOINED = f"{PLANT}merges = 1\nmerge_1_at = 400\nmerge_1_mode = 1\nmerge_1_limit = 10\n"
GEOMETRY = Geometry(merges=(MergePlan(400.0, Mode.LANE, 15.0, 10.0),))


def device(**options: object) -> VirtualConveyor:
    given = {"start": "automatic", "interval": 5.0, "longest": 40.0, "settings": QUICK, "lane_interval": 0.0, **options}
    return VirtualConveyor(GEOMETRY, **given)  # type: ignore[arg-type]


@pytest.mark.sweep(8)
def test_a_merge_is_opened_and_closed_and_says_so_itself(tmp_path: Path) -> None:
    plc = device(arrivals=False)
    with hall(tmp_path, JOINED, plc) as here:
        assert (
            here.value("configuration_differs") == here.value("merges_differ") == 0 and here.value("device_merges") == 1
        )
        here.ivo.take("c1")
        here.do("merge_close_1")
        assert here.value("merge_gate_1") == 2
        plc.write(6, own.REG_LANE_PUT, [1])
        assert until(lambda: "merge_1" in here.alarms(), 30)
        assert until(lambda: here.value("merge_state_1") == 3, 5) and here.value("merged_1") == 0
        page = here.page()
        assert "Merge 1: lane blocked" in page
        assert "c-merge blocked" in page and "Blocked" in page
        here.do("merge_open_1")
        assert until(lambda: here.value("merged_1") == 1, 15)
        assert until(lambda: "merge_1" not in here.alarms(), 15)
        here.do("merge_automatic_1")
        assert here.value("merge_gate_1") == 0 and until(lambda: here.value("merge_state_1") == 0, 10)


@pytest.mark.sweep(8)
def test_a_merged_product_says_where_it_came_from(tmp_path: Path) -> None:
    plc = device(lane_interval=6.0)
    with hall(tmp_path, JOINED, plc) as here:
        assert until(lambda: here.value("merged_1") == 2 and here.value("unloaded") >= 2, 120)
        assert until(lambda: any(one and one.origin for one in plc.tracking.slots), 60)
        here.client.pass_time(0.5)
        slot, record = next((n, one) for n, one in enumerate(plc.tracking.slots, 1) if one and one.origin)
        assert (here.value(f"infeed_{slot}_id"), here.value(f"infeed_{slot}_lane")) == (record.id, 1)
        assert 'title="from lane 1">M1<' in re.sub(r"\s+", " ", here.page())
        assert "Lane that it came from" in here.page(f"/table/product/{record.id}")
        assert until(lambda: record.id not in [one.id for one in plc.tracking.slots if one], 60)
        here.client.pass_time(3)
        sheet = here.ivo.get("/records/passage/export.csv?equipment=c1&locale=machine", fragment=False).text
        rows = [line.split(",") for line in sheet.splitlines()]
        begin = next((n for n, row in enumerate(rows) if "product" in row), -1)
        assert begin >= 0, sheet
        at = rows[begin].index("product"), rows[begin].index("lane")
        lanes = {row[at[0]]: row[at[1]] for row in rows[begin + 1 :] if len(row) > 3}
        assert lanes[str(record.id)] == "1" and "" in lanes.values(), sheet
        assert "Product merged" in here.page("/events")
        assert (here.value("lost"), here.value("unexpected")) == (0, 0)


@pytest.mark.sweep(8)
def test_a_stuck_stop_is_told_and_the_line_runs_on(tmp_path: Path) -> None:
    plc = device()
    with hall(tmp_path, JOINED, plc) as here:
        plc.write(16, training.REG_MACHINE_FAULT, [MERGE_FAULTS + 1])
        plc.write(6, own.REG_LANE_PUT, [1])
        assert until(lambda: "merge_1" in here.alarms(), 90)
        assert until(lambda: (here.value("unloaded") or 0) > 0, 90) and here.value("merged_1") == 0
        plc.write(16, training.REG_MACHINE_FAULT, [0])
        assert until(lambda: here.value("merged_1") == 1 and "merge_1" not in here.alarms(), 60)


@pytest.mark.sweep(8)
def test_in_emergency_stop_a_merge_may_be_closed_only(tmp_path: Path) -> None:
    plc = device(arrivals=False)
    with hall(tmp_path, JOINED, plc) as here:
        here.ivo.take("c1")
        plc.write(16, training.REG_MACHINE_FAULT, [50])
        assert until(lambda: here.value("state") == 6, 10)
        assert "the lanes have no supply" in line_of(here.press("merge_open_1"))
        here.do("merge_close_1")
        assert here.value("merge_gate_1") == 2


@pytest.mark.sweep(8)
@pytest.mark.parametrize("plant", [PLANT, JOINED])
def test_a_plc_of_map_1_5_goes_on_working_and_has_no_merge(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, plant: str
) -> None:
    monkeypatch.setattr(plc_map, "MINOR", 5)
    plc = VirtualConveyor(start="automatic", interval=4.0, settings=QUICK)
    with hall(tmp_path, plant, plc) as here:
        assert until(lambda: here.value("unloaded") == 1, 60)
        assert here.value("configuration_differs") == (plant == JOINED)
        page = here.page()
        assert ("c-merge unknown" in page) is (plant == JOINED)
        assert "merge_1" not in here.alarms()
        here.ivo.take("c1")
        here.do("stop")
