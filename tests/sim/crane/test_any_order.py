"""No command, lever, fault, setting or restart, in any order, makes the crane do what it must not."""

from random import Random

import pytest

from app.registers.plc_map import real
from app.sim import training
from app.sim.crane import training as own
from app.sim.crane.configuration import AXES
from app.sim.crane.register_map import STAGING, CraneCommand, StepState
from tests.sim.crane.crane_stand import JOGS, Stand
from tests.sim.crane.guard import Guard


class Chaos:
    """A random run, and what has to hold after each of its scans."""

    def __init__(self, seed: int) -> None:
        self.random = random = Random(seed)
        self.stand = Stand(
            start=random.choice(("automatic", "manual", "manual", "stopped")),
            orders=random.random() < 0.5,
            pause=1.0,
            stand=random.randint(1, 4),
            ladle=random.uniform(20, 340),
        )
        crane = self.stand.crane
        places = crane.places
        for name in AXES:
            if random.random() < 0.5:
                low, high = getattr(places, f"{name}_lower_stop_at"), getattr(places, f"{name}_upper_stop_at")
                edge = random.choice((low + 20, low + 300, high - 20, high - 300, random.uniform(low + 20, high - 20)))
                crane.axes[name].axis.position = edge
        crane.speed_step = random.randint(1, 4)
        self.guard = Guard(crane)
        self.stand.watch = self.guard.look

    def go(self, events: int) -> None:
        for _ in range(events):
            self.event()
            self.stand.run(self.random.choice((0.02, 0.1, 0.5, 2.0, 5.0, 10.0)))

    def event(self) -> None:
        random, stand = self.random, self.stand
        match random.choice(("sense", "sense", "sense", "jog", "release", "command", "fault", "heal", "rare")):
            case "sense":  # what somebody would do who wants to get on
                stand.talker.fault(0)
                stand.lever = 0
                stand.run(3.0)
                stand.talker.ask(CraneCommand.RESET)
                if random.random() < 0.6:
                    stand.talker.ask(CraneCommand.MANUAL)
                    stand.talker.ask(CraneCommand.SELECT_STEP, random.randint(1, 4))
                    stand.lever = random.choice(list(JOGS.values()))
                else:
                    stand.talker.ask(CraneCommand.AUTOMATIC)
                    stand.talker.ask(CraneCommand.RESUME)
                    stand.talker.ask(
                        CraneCommand.START_CYCLE, stand.crane.load.stand, random.randint(1, 4), real(200.0)
                    )
                stand.run(random.choice((1.2, 3.0, 8.0, 20.0)))
            case "jog":
                stand.lever = random.choice([*JOGS.values(), random.randint(0, 63)])
            case "release":
                stand.lever = 0
            case "command":
                code = random.choice(
                    [*CraneCommand, CraneCommand.MANUAL, CraneCommand.RESET, CraneCommand.AUTOMATIC, 99]
                )
                first = random.randint(0, 5)
                if code == CraneCommand.CONFIRM_WEIGHT:
                    first = real(stand.crane.load.hanging + random.choice((0, 0.5, 30)))
                stand.talker.ask(code, first, random.randint(0, 5), real(random.uniform(0, 400)))
            case "fault":
                code = random.choice(own.FAULTS)
                stand.talker.fault(code)
            case "heal":
                stand.talker.fault(0)
                if random.random() < 0.7:
                    stand.lever = 0
                    stand.run(1.0)
                    stand.talker.ask(CraneCommand.RESET)
            case "rare":
                what = random.random()
                if what < 0.3:
                    stand.talker.train(training.REG_POWER, 1)
                elif what < 0.6:
                    stand.talker.train(own.REG_LADLE, random.randint(0, 4000))
                else:
                    stand.talker.commit({"hoist_slow_down_time": random.uniform(1.0, 6.0)}, STAGING)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("seed", range(6))
def test_no_order_fault_or_timing_makes_it_do_what_it_must_not(seed: int) -> None:
    chaos = Chaos(seed)
    chaos.go(25)
    assert chaos.stand.crane.cycle.state in StepState


@pytest.mark.sweep(8)
def test_the_runs_do_move_the_crane() -> None:
    moved = 0.0
    for seed in range(100, 102):
        chaos = Chaos(seed)
        chaos.go(25)
        moved += chaos.guard.moved
    assert moved > 2 * 2000.0


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(1000, 1200))
def test_no_longer_run_does_either(seed: int) -> None:
    Chaos(seed).go(120)
