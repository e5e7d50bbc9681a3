"""What an instructor may do to a simulated machine of a type: `training.toml`.

    live = ["state", "line_speed"]          points that are shown beside it
    names = "status"                        point whose texts name the faults; without it the texts `training.fault.<code>` do

    [faults]                                machine faults: name on the command line → code (0xE010)
    jam_1 = 1

    [world.interval]                        what is set and kept; limits [0, 1] make a switch
    register = 0xE021
    limits = [5, 6000]
    unit = "× 0.1 s"
    [acts.put]                              what acts once and reads 0
    [switches.sensor]                       bits that are turned over one by one

The texts are `training.<key>` of each of them, `training.fault.<code>` or `….<tens>x` with {n} for its last digit (from 100 on
`….<hundreds>xx` with {n} for its last two), and what the trainee sees then: `training.sees.<code>`, `….<tens>x` or `….any`.
The registers are those of the virtual device
(sim/<type>/training.py); a test holds both against each other.
"""

from collections.abc import Iterator, Mapping, Sequence

from app.plant.definitions import Training, TrainingWord
from app.plant.said import said
from app.plant.tables import Table, one_of

FIRST, LAST = 0xE020, 0xE03F
"""Registers of a device's own in the training area."""


def read_training(file: Table, points: Sequence[str]) -> Training:
    """The training of a type with these points; mistakes are noted in `file`."""
    faults = file.table("faults")
    codes = {name: faults.whole(name, low=1) for name in faults.data}
    for name, code in codes.items():
        if list(codes.values()).count(code) > 1:
            faults.note(name, code, said("mistake.code_once"))
    live = file.items("live", [])
    for index, name in enumerate(live):
        if name not in points:
            file.note(f"live.{index}", name, one_of(points, name))
    training = Training(
        faults=codes,
        names=file.text("names", "", choices=points),
        live=[name for name in live if name in points],
        world=_words(file, "world"),
        acts=_words(file, "acts"),
        switches=_words(file, "switches"),
    )
    file.done()
    return training


def text_keys(training: Training) -> Iterator[str]:
    """Texts that every training of its kind needs; those of single codes may stand for tens, too."""
    for key in (*training.world, *training.acts, *training.switches):
        yield f"training.{key}"


def text_of_code(texts: Mapping[str, Mapping[str, str]], table: str, code: int) -> str:
    """The key below `table` that speaks of `code`: of itself, of its tens, hundreds, of any; empty when no language has one."""
    wider = f"{table}.{code // 100}xx" if code >= 100 else f"{table}.{code // 10}x"
    keys = (f"{table}.{code}", wider, f"{table}.any")
    return next((key for key in keys if any(key in own for own in texts.values())), "")


def _words(file: Table, group: str) -> dict[str, TrainingWord]:
    found: dict[str, TrainingWord] = {}
    for key, table in file.tables(group):
        register = table.whole("register", low=FIRST, high=LAST)
        match table.items("limits"):
            case [int() as low, int() as high] if 0 <= low <= high <= 0xFFFF:
                found[key] = TrainingWord(register, low, high, table.text("unit", ""))
            case other:
                table.note(
                    "limits",
                    other,
                    said("mistake.pair", pair="[lowest, highest]", order="0 <= lowest <= highest <= 65535"),
                )
        table.done()
    return found
