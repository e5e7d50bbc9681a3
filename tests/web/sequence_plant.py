"""A plant with a coil car, its transport sequence, and a short sequence without a machine; and what its ring would tell in March."""

from dataclasses import replace
from pathlib import Path

from sqlalchemy import Connection

from app.historian.events import Delivery, EndedCommand, attribute, store
from app.historian.records import RecordFold
from app.plant.definitions import Plant
from tests.historian.rings import BEGIN, SECOND
from tests.historian.sequence_rings import Device


def _label(hr: str, en: str, de: str, cs: str) -> str:
    return f'label = {{ hr = "{hr}", en = "{en}", de = "{de}", cs = "{cs}" }}'


PRESSURE = f"""
[steps.permissives.3]
key = "pressure_ok"
{_label("Tlak hidraulike u redu", "Hydraulic pressure OK", "Hydraulikdruck in Ordnung", "Tlak hydrauliky v pořádku")}
when = "pressure > 80"
value = "pressure"
[steps.permissives.5]
key = "drives_ok"
{_label("Pogoni spremni", "Drives ready", "Antriebe bereit", "Pohony připraveny")}
when = "drive_horizontal == 1 and drive_vertical == 1"
forceable = false
"""
STEPS = {
    "lower": ("Spusti kolica", "Lower the coil car", "Bundwagen senken", "Spustit vozík"),
    "drive": ("Vozi ispod trna", "Drive under the mandrel", "Unter den Dorn fahren", "Jet pod trn"),
    "lift": ("Podigni do koluta", "Lift to the coil", "Zum Bund heben", "Zvednout ke svitku"),
}
TRANSPORT = (
    "[sequence]\n"
    + _label("Prijevoz koluta", "Coil transport", "Bundtransport", "Přeprava svitku")
    + "".join(
        f'\n[[steps]]\nkey = "{key}"\n{_label(*words)}\nminimum = 0.5\nmaximum = 30.0\nloss_aborts = true\nactions = []\n{PRESSURE}'
        for key, words in STEPS.items()
    )
    + '\n[abort.0]\nkey = "guards"\n'
    + _label("Zaštitne ograde zatvorene", "Guards closed", "Schutztüren geschlossen", "Ochranné dveře zavřeny")
    + '\nwhen = "emergency_stop == 0"\n'
)
SHORT = (
    "[sequence]\n"
    + _label("Vježba", "Exercise", "Übung", "Cvičení")
    + "".join(
        f'\n[[steps]]\nkey = "s{n}"\n{_label(f"Korak {n}", f"Stage {n}", f"Stufe {n}", f"Fáze {n}")}\nminimum = 0.2\nmaximum = 20.0\n'
        "[steps.permissives.0]\n" + _label("Spremno", "Ready", "Bereit", "Připraveno") + "\n"
        for n in (1, 2)
    )
)
PLANT = f"""
[plant]
name = {{ hr = "Linija", en = "Line", de = "Linie", cs = "Linka" }}
timezone = "Europe/Zagreb"
languages = ["hr", "en", "de", "cs"]
[areas.coils]
{_label("Koluti", "Coils", "Bunde", "Svitky")}
[links.coil]
transport = "memory"
{_label("Veza", "Link", "Verbindung", "Spojení")}
[equipment.cc1]
type = "coil_car"
link = "coil"
unit = 20
area = "coils"
{_label("Kolica za kolute", "Coil car", "Bundwagen", "Vozík")}
[equipment.seq1]
type = "sequence"
link = "coil"
unit = 21
area = "coils"
definition = "coil_transport"
machine = "cc1"
{_label("Prijevoz koluta 1", "Coil transport 1", "Bundtransport 1", "Přeprava svitku 1")}
[equipment.seq2]
type = "sequence"
link = "coil"
unit = 22
area = "coils"
definition = "short"
simulation = {{ start = "idle" }}
{_label("Vježba 2", "Exercise 2", "Übung 2", "Cvičení 2")}
"""


def write(folder: Path) -> Path:
    (folder / "sequences").mkdir(parents=True)
    (folder / "plant.toml").write_text(PLANT, "utf-8")
    (folder / "sequences" / "coil_transport.toml").write_text(TRANSPORT, "utf-8")
    (folder / "sequences" / "short.toml").write_text(SHORT, "utf-8")
    return folder


def fill(connection: Connection, plant: Plant, many: int = 64, begin: int = BEGIN) -> None:
    """Runs of `seq1` from `begin` on: many that went well, and of each kind that stops one; the newest is still under way."""
    fold = RecordFold(plant.equipment.values())
    device = Device(time=begin, dt=0.01)
    for number in range(many):
        device.time += 60 * SECOND
        device.run()
        if number % 16 == 15:
            device.start()
            device.scan(30)
            device.lose(0, 0)
            device.scan()
            device.give()
    device.time += 60 * SECOND
    device.tell(device.block.force(3, 3, 120.0, device.time))
    forced = device.time
    device.time += 5 * SECOND
    device.start()
    device.scan(20)
    device.scan(40, suspend=True)
    device.scan(60)
    device.lose(3, 3, 77.25)
    device.scan(12)
    device.give()
    device.scan(3)
    device.lose(2, 3, 61.5)
    device.scan()
    aborted = device.time
    device.time += 9 * SECOND
    device.give()
    device.start()
    device.lose(2, 5)
    while device.block.running:
        device.scan()
    device.give()
    device.time += 30 * SECOND
    device.start()
    device.scan(60)
    device.power_cycle()
    device.start()
    device.scan(20)
    told = device.drain()
    asked = (
        (15, "=Ana; Kos", 'sensor "B3" wet\n=HYPERLINK("x")', forced),
        (1, "Ivo Ban", "", forced + 5 * SECOND),
        (5, "Ivo Ban", "coil not round", forced + 5 * SECOND),
        (14, "=Ana; Kos", "", aborted + 9 * SECOND),
    )
    for request, (code, _, _, at) in enumerate(asked, 1):
        first = next(event for event in told if event.code == code and event.time >= at)
        told = [replace(event, request=request) if event is first else event for event in told]
    store(connection, Delivery("seq1", told), (fold,), begin)
    for request, (code, person, why, at) in enumerate(asked, 1):
        assert attribute(connection, EndedCommand("seq1", (request,), person, why, at, at + SECOND), (fold,)), code
    connection.exec_driver_sql("DELETE FROM event_mark WHERE equipment = 'seq1'")
