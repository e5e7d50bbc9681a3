"""A script: what people and faults do to a plant, and when, drawn from a seed.

An action carries everything that was drawn for it, so that a script with actions taken away is a script again.
"""

from dataclasses import dataclass, field
from random import Random
from typing import Any

from tests.demo_plant import MACHINES

PEOPLE = {
    "ana": ("operator",),
    "ivo": ("operator",),
    "eva": ("operator", "engineer"),
    "vit": ("viewer",),
    "ada": ("admin", "engineer", "operator"),
}
"""Name → roles at the beginning."""
PLANTS = (("m1", "m2"), ("c1",), ("m1", "c1"), ("cc1", "seq1"), ("m1", "m2"), ("c1",), ("cr1",), ("m2", "a1"))
"""Few machines of the demo, which seeds choose from; every tenth has all."""
DRIVES = (("d1", "d2"), ("d2", "m2"))
"""Of seeds that end in 7: d1 and d2 have parameters behind a mailbox."""
CARRIERS = ("memory", "tcp", "rtu")
"""What the lines of the plant are; seeds take them by turns."""
WEB = (False, True, False, False)
"""Whether people sit at browsers; by turns, too."""
CALM = 20.0
"""At the end nothing goes wrong any more for so long, and everything has to be well again [s]."""

ACTS = {
    "enter": 6, "leave": 2, "look": 2, "take": 8, "give": 2, "want": 2, "command": 18, "set": 10, "sets": 6, "stop": 6, "hold": 8,
    "acknowledge": 4, "hide": 5, "roles": 2, "bar": 1,
}  # fmt: skip
WEB_ACTS = {**ACTS, "look": 5, "program": 6, "factor": 2}
DRIVE_ACTS = {"change": 10, "save": 2}
DRIVE_FAULTS = {"mailbox": 5}
"""Besides, where there are such drives."""
FAULTS = {
    "line": 10, "unplug": 1, "power": 2, "freeze": 3, "fault": 4, "disk": 4, "clock": 2, "reload": 2, "redefine": 1, "kill": 2,
    "restart": 1, "stall": 2,
}  # fmt: skip
"""Kind of action → share."""
LINE_FAULTS = (
    "cable", "lost", "late", "slow", "doubled", "garbled", "unit", "function", "short", "long", "exception",
    "reset",
)  # fmt: skip
HIDINGS = ("shelve", "shelve", "once", "unshelve", "take_out", "put_back")
"""How somebody puts an alarm aside, or brings one back."""
HOLDS = ("steady", "late", "ends", "backwards", "gone")
DISKS = ("full", "locked", "failing")


@dataclass(frozen=True)
class Action:
    """One thing that happens."""

    at: float
    """Since the beginning [s]."""
    kind: str
    given: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        told = " ".join(f"{name}={value!r}" for name, value in self.given.items())
        return f"{self.at:9.3f}  {self.kind:12} {told}".rstrip()


@dataclass(frozen=True)
class Script:
    """What happens to a plant."""

    seed: int
    machines: tuple[str, ...]
    seconds: float
    actions: tuple[Action, ...]
    carrier: str = "memory"
    """One of `CARRIERS`."""
    web: bool = False
    """People sit at browsers; else they call the house themselves."""

    def __str__(self) -> str:
        plant = f"plant {' '.join(self.machines)} over {self.carrier}{', browsers' if self.web else ''}"
        head = f"seed {self.seed}, {self.seconds:g} s, {plant}, {len(self.actions)} actions"
        return "\n".join([head, *map(str, self.actions)])


def draw(seed: int, minutes: float = 1.0, machines: tuple[str, ...] = (), carrier: str = "") -> Script:
    """The script of `seed`: its last `CALM` seconds are quiet."""
    random = Random(f"storm {seed}")
    machines = machines or (random.choice(DRIVES if seed % 10 == 7 else PLANTS) if seed % 10 else MACHINES)
    drives = _have_mailbox(machines)
    seconds, web = minutes * 60, WEB[seed % len(WEB)]
    acts = (WEB_ACTS if web else ACTS) | (DRIVE_ACTS if drives else {})
    faults = FAULTS | (DRIVE_FAULTS if drives else {})
    wild = max(5.0, seconds - CALM)
    pace, trouble = random.choice((0.15, 0.3, 0.6)), random.choice((0.0, 0.15, 0.3, 0.5))
    """Seconds between two actions; part of them that are faults."""
    actions = [Action(round(0.2 + 0.1 * n, 3), "enter", {"who": who}) for n, who in enumerate(("ana", "ivo", "ada"))]
    actions += [Action(0.6, "take", {"who": _at_work(machines), "machine": random.choice(machines)})]
    at = 1.0
    while True:
        at += random.expovariate(1 / pace)
        if at >= wild:
            break
        shares = faults if random.random() < trouble else acts
        kind = random.choices(list(shares), list(shares.values()))[0]
        actions.append(Action(round(at, 3), kind, _given(kind, random, machines)))
    return Script(seed, machines, seconds, tuple(actions), carrier or CARRIERS[seed % len(CARRIERS)], web)


def _have_mailbox(machines: tuple[str, ...]) -> bool:
    return not {"d1", "d2"}.isdisjoint(machines)


def _at_work(machines: tuple[str, ...]) -> str:
    """Who mostly has control: somebody who may write parameters, where there are any."""
    return "ada" if _have_mailbox(machines) else "ana"


def _given(kind: str, random: Random, machines: tuple[str, ...]) -> dict[str, Any]:
    who = (
        _at_work(machines)
        if kind in ("command", "set", "sets", "hold") and random.random() < 0.6
        else random.choice(list(PEOPLE))
    )
    machine = random.choice(machines)
    number = random.randrange(1000)
    match kind:
        case "enter" | "leave" | "look":
            return {"who": who}
        case "take" | "give" | "want" | "stop":
            return {"who": who, "machine": machine}
        case "command":
            return {
                "who": who,
                "machine": machine,
                "number": number,
                "part": round(random.random(), 3),
                "twice": random.random() < 0.1,
            }
        case "set":
            return {"who": who, "machine": machine, "number": number, "part": round(random.uniform(-0.2, 1.2), 3)}
        case "sets":
            parts = [round(random.uniform(-0.05, 1.05), 3) for _ in range(random.choice((2, 3, 5)))]
            return {"who": who, "machine": machine, "number": number, "parts": parts}
        case "change":
            parts = [round(random.uniform(-0.05, 1.05), 3) for _ in range(random.choice((1, 2, 8, 25)))]
            return {
                "who": random.choice(("ada", "ada", "eva")), "machine": machine, "number": number, "parts": parts,
                "cancelled": random.random() < 0.1,
            }  # fmt: skip
        case "save":
            return {"who": "ada", "machine": machine}
        case "mailbox":
            return {"machine": machine, "number": number, "seconds": round(random.uniform(0.2, 8), 1)}
        case "hold":
            seconds = round(random.uniform(0.1, 4), 1)
            return {"who": who, "machine": machine, "number": number, "how": random.choice(HOLDS), "seconds": seconds}
        case "program":
            return {"who": who, "machine": machine, "number": number, "seconds": round(random.uniform(0.2, 6), 1)}
        case "acknowledge":
            return {"who": who, "number": number}
        case "hide":
            minutes = random.choice((1, 1, 2, 30, 600))
            who = random.choice(("ana", "ada", "ada", "eva"))
            return {"who": who, "number": number, "how": random.choice(HIDINGS), "minutes": minutes}
        case "factor":
            return {"who": who, "seconds": round(random.uniform(0.5, 8), 1)}
        case "roles":
            return {"who": who, "roles": random.choice((("viewer",), ("operator",), ("operator", "engineer")))}
        case "bar":
            return {"who": who, "seconds": round(random.uniform(0.5, 15), 1)}
        case "line":
            return {
                "machine": machine, "fault": random.choice(LINE_FAULTS), "part": random.choice((0.05, 0.3, 1.0)),
                "seconds": round(random.choice((0.3, 1, 3, 10)) * random.uniform(0.5, 1.5), 2),
            }  # fmt: skip
        case "power":
            return {"machine": machine}
        case "unplug":
            return {"machine": machine, "seconds": round(random.uniform(0.1, 5), 2)}
        case "freeze" | "fault":
            return {"machine": machine, "number": number, "seconds": round(random.uniform(0.2, 8), 1)}
        case "disk":
            return {
                "which": random.choice(("db", "history")), "how": random.choice(DISKS),
                "seconds": round(random.choice((0.5, 3, 12)) * random.uniform(0.5, 1.5), 2),
                "after": random.choice((0, 1, random.randrange(2, 40))),
            }  # fmt: skip
        case "clock":
            return {"seconds": random.choice((-3600.0, -60.0, -2.0, -0.5, 0.5, 1.5, 30.0, 3600.0, 86400.0))}
        case "reload":
            return {"machine": random.choice(("extra", machine))}
        case "redefine":
            return {"number": number}
        case "restart":
            return _away(random)
        case "kill":
            return {**_away(random), "point": random.choice((0, 1, 2, random.randrange(3, 60)))}
        case "stall":
            return {"seconds": round(random.choice((0.2, 0.4, 1.0, 2.5, 6.0)) * random.uniform(0.8, 1.2), 2)}
    raise ValueError(kind)


def _away(random: Random) -> dict[str, float]:
    """How long a server is away, and by how much the wall clock is set meanwhile [s]."""
    seconds = round(random.choice((0.0, 0.5, 4.0)) * random.uniform(0.5, 1.5), 2)
    return {"seconds": seconds, "clock": random.choice((0.0, 0.0, -3600.0, -2.0, 1.5, 30.0, 3600.0, 86400.0))}
