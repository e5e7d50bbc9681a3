"""A plant of a coil car with its transport sequence and of a sequence without a machine, for tests of pages."""

from pathlib import Path

PLANT = """
[plant]
name = { hr = "Pogon", en = "Plant", de = "Werk", cs = "Závod" }
timezone = "Europe/Zagreb"
languages = ["hr", "en", "de", "cs"]

[links.coil]
transport = "memory"
writes = true

[equipment.cc1]
type = "coil_car"
link = "coil"
unit = 20
saddle_2_position = 5500
saddle_1_position = 6800
travel = 7500
label = { hr = "Kolica", en = "Coil car", de = "Bundwagen", cs = "Vozík" }

[equipment.cc1.simulation]
start = "automatic"
coil = 1
growth = 400
crane = 3
automatic_horizontal = 600
acceleration_horizontal = 500
jerk_horizontal = 2000
automatic_vertical = 150
acceleration_vertical = 300
jerk_vertical = 1000

[equipment.seq1]
type = "sequence"
link = "coil"
unit = 21
definition = "transport"
machine = "cc1"
label = { hr = "Transport koluta", en = "Coil transport", de = "Bundtransport", cs = "Přeprava svitku" }

[equipment.seq2]
type = "sequence"
link = "coil"
unit = 22
definition = "drill"
label = { hr = "Vježba", en = "Drill", de = "Übung", cs = "Cvičení" }
"""
STEPS = (
    ("lower", "Lower the car", "lower", "coil_ready", "Coil is finished", "coil_ready == 1"),
    ("drive_in", "Drive under the mandrel", "drive_to_mandrel", "lowered", "Car is lowered", "lowered == 1"),
    ("lift", "Lift to the coil", "lift_to_coil", "at_mandrel", "Car is under the mandrel", "at_mandrel == 1"),
    ("collapse", "Collapse the mandrel", "collapse", "contact", "Coil touches the car", "coil_contact == 1"),
    ("drive_out", "Drive out", "drive_out", "on_car", "Coil is on the car", "coil_on_car == 1"),
    ("lift_over", "Lift over the saddle", "lift_over_saddle", "at_out", "Car is in the free zone", "at_out == 1"),
    ("drive", "Drive to the saddle", "drive_to_saddle", "over", "Car is over the saddles", "over_saddle == 1"),
    ("lay", "Lower the coil", "lower_onto_saddle", "at_target", "Car is at its saddle", "at_target == 1"),
)
"""Key, label, action; key, label and sentence of what each step needs besides pressure."""


def transport() -> str:
    """The eight steps of the original, with a short stall."""
    lines = ["[sequence]", 'label = "Coil transport"', "stall_after = 0.5"]
    for key, label, action, needs, name, when in STEPS:
        lines += ["[[steps]]", f'key = "{key}"', f'label = "{label}"', f'actions = ["{action}"]']
        lines += ["minimum = 0.5", f"maximum = {60 if key != 'lay' else 90}"]
        lines += ["[steps.permissives.2]", 'key = "pressure_ok"', 'label = "Pressure is there"']
        lines += ['when = "pressure > 80"', 'value = "pressure"']
        lines += [
            "[steps.permissives.6]",
            f'key = "{needs}"',
            f'label = "{name}"',
            f'when = "{when}"',
            "forceable = false",
        ]
    lines += ["[abort.0]", 'label = "Emergency stop is not pressed"', 'when = "emergency_stop == 0"']
    return "\n".join(lines)


def drill(steps: int = 12, longest_force: int = 6, *, ways: bool = False) -> str:
    """A sequence that nothing moves: its second step stays; `ways`: of twelve steps some stand in branches and a loop."""
    lines = ["[sequence]", 'label = "Drill"', f"longest_force = {longest_force}"]
    lines += ['abort_to = "s12"'] if ways else []
    for number in range(1, steps + 1):
        lines += ["[[steps]]", f'key = "s{number}"', f'label = "Exercise {number}"', "minimum = 1"]
        lines += [f"maximum = {0 if number == 2 else 600}"]
        lines += ["[steps.permissives.1]", f'label = "Tank {number} is ready"']
        lines += ["[steps.permissives.2]", 'label = "Guard is closed"', "forceable = false"]
    lines += ["[abort.0]", 'label = "Emergency stop is not pressed"']
    if ways:
        lines += ["[[branches]]", 'after = "s3"', 'take = "all"', 'paths = ["s4", "s8"]', 'then = "s9"']
        lines += ["[[branches]]", 'after = "s4"', 'take = "first"', 'paths = ["s5", "s6"]', 'then = "s7"']
        lines += ["[[loops]]", 'from = "s9"', 'to = "s11"', "times = 3"]
    return "\n".join(lines)


def write(folder: Path, link: str = '"memory"', *, ways: bool = False) -> Path:
    """The plant as files in `folder`; `link`: its transport as TOML, with what goes with it."""
    (folder / "sequences").mkdir(parents=True, exist_ok=True)
    (folder / "plant.toml").write_text(PLANT.replace('"memory"', link), "utf-8")
    (folder / "sequences" / "transport.toml").write_text(transport(), "utf-8")
    (folder / "sequences" / "drill.toml").write_text(drill(ways=ways), "utf-8")
    return folder
