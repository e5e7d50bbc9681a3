"""A stand for the gate with a machine that takes codes: the type of tests/plant/line.py behind a link that is written by hand."""

import asyncio
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from app.access.roles import Person
from app.errors import BadAnswer, DeviceException, LinkError, NoAnswer, NotConnected, Overtaken
from app.plant.definitions import Plant, Scan
from app.plant.loader import read_plant
from app.registers.plc_map import HOLD_TIMEOUT, Answer, AnswerState
from tests.commands.stand import Drive, FakeLink, Stand, settle
from tests.plant.line import PLANT, write_type

START, STOP, CLEAR, EDIT = 1, 2, 4, 6


@cache
def read_line() -> Plant:
    with TemporaryDirectory() as folder:
        (Path(folder) / "plant.toml").write_text(PLANT, "utf-8")
        plant, problems = read_plant(Path(folder), type_folder=write_type(Path(folder)))
    assert plant is not None, problems
    return plant


class Line(Drive):
    """What the machine does with a code at once, and with request bits while their counter changes."""

    def __init__(self) -> None:
        super().__init__()
        self.values = {"state": 0, "moving": 0, "count": 0, "length": 660.0, "speed": 30.0, "delay": 1.0}
        self.bits = self.counter = 0
        self.seen = float("-inf")

    def act(self, code: int) -> None:
        if self.deaf:
            return
        if code == START:
            self.values |= {"state": 1, "moving": 1}
        elif code == STOP:
            self.values |= {"state": 0, "moving": 0}
            self.bits = 0

    def request(self, bits: int, counter: int, now: float) -> None:
        if counter != self.counter:
            self.seen, self.counter = now, counter
        self.bits = bits
        self.values["moving"] = int(bits > 0 and not self.deaf)

    def watch(self, now: float) -> None:
        """The device's own watchdog: a counter that does not change means released."""
        if self.bits and now - self.seen >= HOLD_TIMEOUT:
            self.bits = 0
            self.values["moving"] = 0


class PlcLink(FakeLink):
    """Answers as told: `reply` is what happens to the next orders, `later` what the answer becomes when it is read again."""

    def __init__(self, stand: Stand) -> None:
        super().__init__(stand)
        self.reply = "done"
        self.acts = True
        self.reason = 0
        self.later: list[Answer | LinkError | AnswerState | None] = []
        self.orders: list[tuple[int, tuple[int, ...], int, bool]] = []
        self.owners: list[int] = []
        self.asked: list[int] = []
        self.held: list[tuple[int, int, bool]] = []
        self.spoil_hold: Callable[[int], LinkError | None] = lambda bits: None
        self.last = Answer(0, AnswerState.NONE)

    async def order(
        self,
        equipment: str,
        code: int,
        arguments: Sequence[int] = (),
        *,
        expected: int = 0,
        owner: int = 0,
        request: int = 0,
        urgent: bool = False,
    ) -> Answer:
        assert request == 0
        self.orders.append((code, tuple(arguments), expected, urgent))
        self.owners.append(owner)
        reply, acts = self.reply, self.acts
        await asyncio.sleep(0)
        if not urgent:
            await self.turn()
        self.stand.clock.advance(0.001)
        line = self.stand.drives[equipment]
        assert isinstance(line, Line)
        if acts and reply in ("accepted", "running", "done", "lost"):
            line.act(code)
        errors = {
            "none": NoAnswer("nothing"),
            "lost": NoAnswer("the answer was lost"),
            "not_arrived": LinkError("no trace of it"),
            "refused": DeviceException(2),
            "busy": DeviceException(5),
            "not_connected": NotConnected("never sent"),
            "bad_answer": BadAnswer("half an answer"),
            "overtaken": Overtaken("a stop came first"),
        }
        if reply in errors:
            raise errors[reply]
        self.last = Answer(len(self.orders), AnswerState[reply.upper()], self.reason)
        return self.last

    async def answer(self, equipment: str, id: int) -> Answer | None:
        self.asked.append(id)
        await asyncio.sleep(0)
        found = self.later.pop(0) if self.later else self.last
        if isinstance(found, LinkError):
            raise found
        if isinstance(found, AnswerState):
            found = Answer(id, found, self.reason)
        self.last = found or self.last
        return found

    async def hold(
        self, equipment: str, bits: int, counter: int, argument: float = 0.0, *, urgent: bool = False
    ) -> None:
        assert argument == 0.0
        self.held.append((bits, counter, urgent))
        await asyncio.sleep(0)
        if not urgent:
            await self.turn()
        self.stand.clock.advance(0.001)
        error = self.spoil_hold(bits)
        if error is not None and not self.acts_although_spoiled:
            raise error
        line = self.stand.drives[equipment]
        assert isinstance(line, Line)
        line.request(bits, counter, self.stand.clock.monotonic())
        if error is not None:
            raise error


class PlcStand(Stand):
    """One line, `k1`."""

    drive_class = Line
    link_class = PlcLink

    def __init__(self, *, dry_run: bool = False, plant: Plant | None = None) -> None:
        super().__init__(dry_run=dry_run, plant=plant or read_line())

    @property
    def plc(self) -> PlcLink:
        assert isinstance(self.link, PlcLink)
        return self.link

    @property
    def line(self) -> Line:
        line = self.drives["k1"]
        assert isinstance(line, Line)
        return line

    def publish(self, equipment: str, *scans: Scan) -> None:
        self.line.watch(self.clock.monotonic())
        super().publish(equipment, *scans)

    async def give(self, who: Person, command: str, **asked: object) -> str:
        """Ask for a command; the state that it has at once."""
        progress = await self.ask(who, command, "k1", **asked)
        return str(progress.state)

    async def open_door(self) -> None:
        self.link.door.set()
        await settle()
