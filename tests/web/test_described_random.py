"""Random people, at once, at a described machine whose bits share words, over random lines: Stop has the last word, what is shown is so."""

import asyncio
from collections import Counter
from contextlib import suppress
from pathlib import Path
from random import Random

import pytest

from app import chance
from app.access.roles import Person
from app.commands.gate import Gate
from app.commands.lifecycle import Progress, ProgressState
from app.errors import Refused
from app.plant.loader import read_plant
from app.settings import Settings
from app.sim.bus import Bus, LineFaultMode
from app.sim.plant import SimPlant
from app.sim.server import serve_tcp
from tests.virtual import VirtualClient, house, loop_clock, until
from tests.web.operating import runtime_of
from tests.web.people import AGENT, Staff
from tests.wires import SerialLine, sim_server

PORT = 1502
QUIET = 16.0
"""After each round [s]: every command has come to its end, and everything has been read again."""
ROUNDS = 8
DEVICE = """label = "type"
area = "water"
[device]
max_write = {max_write}
write_functions = {functions}
connections = {connections}
fast = {fast}
timeout = 0.3
"""
FILES = {
    "points": """
[run]
address = 0
mask = 1
writable = true
texts = [0, 1]
[mode]
address = 0
mask = 15
shift = 4
kind = "step"
writable = true
[speed]
address = 1
unit = "%"
low = 0
high = 100
[running]
address = 2
mask = 1
texts = [0, 1]
""",
    "setpoints": """
[wanted]
address = 10
unit = "%"
low = 0
high = 100
role = "operator"
[soft]
address = 11
mask = 255
low = 0
high = 200
role = "operator"
""",
    "commands": """
[start]
writes = [{ point = "mode", value = 3 }, { point = "run", value = 1 }]
feedback = "running == 1"
timeout = 3
[slow]
writes = [{ point = "mode", value = 1 }]
feedback = "mode == 1"
timeout = 3
[fast]
writes = [{ point = "mode", value = 7 }]
feedback = "mode == 7"
timeout = 3
[stop]
writes = [{ point = "run", value = 0 }]
feedback = "running == 0"
timeout = 4
level = "C0"
stop = true
""",
    "simulation": """
[start]
wanted = 50
soft = 20
[[rules]]
when = "run == 1"
after = 0.1
set = { running = 1 }
[[rules]]
when = "run == 0"
after = 0.1
set = { running = 0 }
[values.speed]
to = "wanted * running"
lag = 0.5
""",
    "texts.en": """
type = "Mixer"
area = "Water"
[point]
run = "Run"
mode = "Mode"
speed = "Speed"
running = "Running"
wanted = "Wanted"
soft = "Soft"
[choice]
run.0 = "off"
run.1 = "on"
running.0 = "off"
running.1 = "on"
[command]
start = "Start"
slow = "Slow"
fast = "Fast"
stop = "Stop"
""",
}
PLANT = """
[plant]
name = "Works"
timezone = "Europe/Zagreb"
languages = ["en"]
[areas.water]
label = "Water"
[links.line]
{carrier}
writes = true
[equipment.x1]
type = "mixer"
link = "line"
unit = 1
label = "Mixer 1"
"""
FUNCTIONS = ("[6]", "[6, 16]", "[6, 22]", "[16]", "[16, 22]")
CARRIERS = ("memory", "tcp", "rtu")
TROUBLE = (
    LineFaultMode.CABLE_PULLED, LineFaultMode.SLOW, LineFaultMode.SLOW, LineFaultMode.SILENT, LineFaultMode.WRONG_LENGTH,
    LineFaultMode.GARBAGE, LineFaultMode.EXCEPTION,
)  # fmt: skip


class Mixer:
    """The machine as it is, whatever anybody is shown."""

    def __init__(self, bus: Bus) -> None:
        self.device = bus.devices[1]

    def word(self, address: int) -> int:
        return self.device.read(3, address, 1)[0]

    @property
    def held(self) -> dict[str, int]:
        control = self.word(0)
        return {
            "run": control & 1, "mode": control >> 4 & 15, "running": self.word(2) & 1, "wanted": self.word(10),
            "soft": self.word(11) & 255,
        }  # fmt: skip

    def trouble(self, random: Random) -> None:
        """The next telegrams come to harm."""
        fault = self.device.line_fault
        fault.argument, fault.delay_ms = random.choice([4, 6, 2]), random.choice([50, 200, 500])
        fault.count, fault.mode = random.randint(1, 6), random.choice(TROUBLE)

    def rest(self) -> None:
        self.device.line_fault.count = self.device.line_fault.mode = 0


class World:
    """One house with the machine on its line, and one person who has many hands."""

    def __init__(self, client: VirtualClient, carrier: str, line: SerialLine | None) -> None:
        self.client, self.runtime = client, runtime_of(client)
        assert self.runtime.problems == []
        assert self.runtime.gate is not None
        self.gate: Gate = self.runtime.gate
        self.carrier, self.line = carrier, line
        self.ends: list[Progress] = []
        self.gate.subscribe_ends(self.ends.append)
        self.sid = Staff(client).enter("ana", "engineer", "operator")

    async def open(self) -> Mixer:
        """The machine: of this server, or behind a port or a serial line."""
        if self.carrier == "memory":
            assert self.runtime.sim is not None
            return Mixer(self.runtime.sim.merged())
        plant, problems = read_plant(self.runtime.settings.plant)
        assert plant, problems
        machines = SimPlant(plant, loop_clock())
        self._running = asyncio.create_task(machines.run())
        bus = machines.merged()
        if self.line is None:
            self._server = await serve_tcp(bus, "127.0.0.1", PORT)
        else:
            opened = sim_server._Line(self.line.ours.fileno(), self.line.close)
            self._server = sim_server.SerialServer(bus, lambda: opened, self.line.path, 115200, paced=True)
            await self._server.start()
        return Mixer(bus)

    async def close(self) -> None:
        if self.carrier != "memory":
            self._running.cancel()
            await self._server.close()

    async def person(self) -> Person:
        found = await self.runtime.access.sessions.find(self.sid, "127.0.0.1", AGENT)
        assert found is not None
        return found

    async def act(self, kind: str, value: int) -> None:
        who, id = await self.person(), chance.token_hex(16)
        told = {"id": id, "confirmed": True, "proven": True, "reason": "random"}
        try:
            if kind in ("wanted", "soft"):
                nonce = self.gate.nonces.issue(who.session)
                await self.gate.set_value(who, "x1", kind, value, nonce=nonce, **told)  # type: ignore[arg-type]
            elif kind == "stop":
                await self.gate.ask(who, "x1", kind, id=id)
            else:
                nonce = self.gate.nonces.issue(who.session)
                await self.gate.ask(who, "x1", kind, nonce=nonce, **told)  # type: ignore[arg-type]
        except Refused:
            pass

    async def round(self, mixer: Mixer, random: Random) -> str:
        """Some hands at once, perhaps on a bad line; the last thing that was asked for."""
        with suppress(Refused):
            self.gate.control.take(await self.person(), "x1")
        if random.random() < 0.5:
            mixer.trouble(random)
        kinds = random.choices(["start", "slow", "fast", "stop", "wanted", "soft"], k=random.randint(1, 4))
        hands = []
        for kind in kinds:
            hands.append(asyncio.create_task(self.act(kind, random.randint(0, 100))))
            await asyncio.sleep(random.choice([0, 0, 0.001, 0.01, 0.05, 0.2]))
        await asyncio.gather(*hands)
        mixer.rest()
        await asyncio.sleep(QUIET)
        return kinds[-1]

    def shown(self) -> dict[str, object]:
        return {
            key: self.runtime.tags.sample(f"x1.{key}").value for key in ("run", "mode", "running", "wanted", "soft")
        }


@pytest.mark.sweep(8)
@pytest.mark.parametrize("carrier", CARRIERS)
@pytest.mark.parametrize("seed", range(3))
def test_a_stop_is_the_last_word_and_what_is_shown_is_so(tmp_path: Path, seed: int, carrier: str) -> None:
    random = Random(f"{seed} {carrier}")
    line = SerialLine() if carrier == "rtu" else None
    where = {
        "memory": 'transport = "memory"',
        "tcp": f'transport = "tcp"\nhost = "127.0.0.1"\nport = {PORT}',
        "rtu": f'transport = "rtu"\nport = "{line.path if line else ""}"\nbaud = 115200\nparity = "none"\nstop_bits = 2',
    }[carrier]
    own = tmp_path / "plant" / "equipment" / "mixer"
    own.mkdir(parents=True)
    device = {"max_write": random.choice([1, 8]), "functions": random.choice(FUNCTIONS)}
    device |= {"connections": random.choice([1, 2, 4]), "fast": random.choice([0.05, 0.2])}
    for name, text in {**FILES, "device": DEVICE.format(**device)}.items():
        (own / f"{name}.toml").write_text(text, "utf-8")
    (tmp_path / "plant" / "plant.toml").write_text(PLANT.format(carrier=where), "utf-8")
    with house(Settings(plant=tmp_path / "plant", data=tmp_path / "data")) as client:
        world = World(client, carrier, line)
        mixer = client.run(world.open())
        assert until(lambda: world.shown()["soft"] == 20, 30)
        for number in range(ROUNDS):
            last = client.run(world.round(mixer, random))
            story = f"seed {seed}, {device}, round {number}: {[(one.command, one.state) for one in world.ends[-5:]]}"
            assert last != "stop" or not (mixer.held["run"] or mixer.held["running"]), story
            assert world.shown() == mixer.held, story
            assert mixer.word(0) & 0xFF0E == 0 and mixer.word(11) >> 8 == 0, "bits that nobody wrote"
        ended = Counter(one.state for one in world.ends)
        assert ended[ProgressState.CONFIRMED] >= 3, ended
        client.run(world.close())
