"""A plant of one conveyor, for tests of pages."""

LINE = """
[plant]
name = { hr = "Pogon", en = "Plant", de = "Werk", cs = "Závod" }
timezone = "Europe/Zagreb"
languages = ["hr", "en", "de", "cs"]

[links.hall]
transport = "memory"
writes = true

[equipment.c1]
type = "conveyor"
link = "hall"
unit = 10
preset = "model"
label = { hr = "Traka 1", en = "Conveyor 1", de = "Förderer 1", cs = "Dopravník 1" }
"""


def plant(simulation: str) -> str:
    """The plant file of a line whose simulation is set up so."""
    return f"{LINE}simulation = {{ {simulation} }}\n"
