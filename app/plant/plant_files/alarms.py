"""`[[alarms]]`: alarms that a plant adds to one of its machines, with texts of its own."""

from dataclasses import replace

from app.plant.plant_files.languages import PlantLanguages
from app.plant.plant_files.machines import Machines
from app.plant.said import said
from app.plant.tables import MISSING, Table
from app.plant.type_files.alarms import read_alarm, sentences_of
from app.plant.type_files.names import KEY, KEY_EXPECTED
from app.plant.type_files.sentences import check_expression

TEXTS = ("label", "consequence", "cause", "response")


def read_plant_alarm(
    row: Table, machines: Machines, languages: PlantLanguages, texts: dict[str, dict[str, str]]
) -> None:
    """One row: its machine gets the alarm, `texts` (language → key → text) its words."""
    given = row.data.get("equipment")
    if isinstance(given, str) and machines.is_unread(given):
        return  # told already, where its type or its definition is
    name = row.text("equipment", choices=sorted(machines.found))
    item = machines.found.get(name) if row.data.get("equipment") == name else None
    key = row.text("key", pattern=KEY, expected=KEY_EXPECTED)
    prefix = f"plant.{name}.{key}."
    for field in TEXTS:
        label = languages.label(row, field, required=field == "label", default="–")
        if field != "label" and not row.has(field):
            row.doubt(field, MISSING, said("mistake.doubt_alarm"))
        for language in languages.known:
            if language in label:
                texts.setdefault(language, {})[prefix + field] = label[language]
    plain = Table(row.source, row.path, {key: value for key, value in row.data.items() if key not in TEXTS})
    for known in ("equipment", "key"):
        plain.raw(known)
    ring = item.type.device.plc if item else None
    alarm = read_alarm(key, plain, prefix, item.type.events if item and ring and ring.events else {})
    plain.done()
    if item is None:
        return
    if any(other.key == key for other in item.alarms):
        row.note("key", key, said("mistake.alarm_key", name=name))
    for field, text in sentences_of(alarm):
        check_expression(row, field, text, item.points, name)
    machines.found[name] = replace(item, alarms=(*item.alarms, alarm))
