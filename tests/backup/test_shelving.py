"""What people put aside is in a backup: who, why and until when, as it was."""

from pathlib import Path

from app.alarms.engine import AlarmEngine
from app.backup import back_up
from app.clock import ManualClock
from app.db import Database
from app.plant.texts import Texts
from tests.alarms.conftest import ANA, HOT, KEY, PRODUCT, TRIP, Plot
from tests.backup.shelf import restore
from tests.virtual import inline


async def test_a_restored_machine_has_its_shelves_and_they_end_when_they_said(
    data: Path, plant: Path, tmp_path: Path
) -> None:
    clock = ManualClock()
    database = Database(data / "pogon.db", "pogon", inline)
    plot = Plot(database, clock)
    engine = await plot.begin(HOT, TRIP)
    plot.put(t=71.0, status=4, after=1)
    shelf = engine.hiding.shelve("m1.hot", ANA, 3600, "Sensor fault").shelf
    engine.hiding.take_out("m1.trip", ANA, "Gearbox replaced", "P-17")
    await engine.journal.flush()
    archive = tmp_path / "b.tar"
    back_up(archive, data, plant)
    engine.hiding.unshelve("m1.hot", ANA)  # what comes after the backup is not in it
    await engine.journal.flush()
    database.close()

    restore(archive, tmp_path / "other")
    again = Database(tmp_path / "other" / "pogon.db", "pogon", inline)
    plot.engine = AlarmEngine(plot.tags, clock, again, Texts(PRODUCT, plot.plant), KEY)
    await plot.engine.load()
    plot.configure(plot.plant)
    hidden = {one.id: one for one in plot.engine.list.hidden()}
    assert hidden["m1.hot"].shelf == shelf and shelf is not None and shelf.reason == "Sensor fault"
    service = hidden["m1.trip"].service
    assert service is not None and (service.by, service.permit) == ("Ana Kos", "P-17")
    plot.wait(3600.0)
    assert [one.id for one in plot.engine.list.active()] == ["m1.hot"], "the shelf ended, service does not"
    again.close()
