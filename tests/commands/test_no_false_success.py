"""Two thousand writes, in `make soak` ten thousand, over a line that does everything wrong, without one false success."""

import random

import pytest

from app.errors import BadAnswer, DeviceException, LinkError, NoAnswer, NotConnected, Overtaken, Refused
from app.plant.definitions import Scan
from app.tags.batch import Batch
from tests.commands.stand import EVA, Stand, settle

WRITES = [2_000, pytest.param(10_000, marks=pytest.mark.soak)]
ERRORS = (NoAnswer("silence"), BadAnswer("noise"), NotConnected("gone"), DeviceException(4), Overtaken("stop"))


class Line(Stand):
    """A stand that publishes only what the test writes, and sometimes nothing."""

    def __init__(self, seed: int) -> None:
        self.chance = random.Random(seed)
        self.lean = False
        super().__init__()
        self.lean = True
        self.acted = False

    def publish(self, equipment: str, *scans: Scan) -> None:
        if not self.lean:
            super().publish(equipment, *scans)
        elif self.chance.random() < 0.8:
            handle, now = self.tags.handle("m1.f114"), self.clock.micros()
            self.tags.publish(Batch("link.hall", 90, now, now, [handle], [self.drive()["f114"]]))

    def spoil(self, equipment: str, point: str, value: float) -> LinkError | None:
        """Acts or not, answers or not, each by chance: an honest echo, a lost answer, a lost telegram, a deaf device."""
        fate = self.chance.random()
        self.acted = fate < 0.55
        self.link.acts_although_spoiled = self.acted
        self.drives["m1"].deaf = not self.acted
        return None if fate < 0.3 or fate > 0.9 else self.chance.choice(ERRORS)


@pytest.mark.sweep(8)
@pytest.mark.slow
@pytest.mark.parametrize("writes", WRITES)
async def test_thousands_of_writes_without_one_false_success(writes: int) -> None:
    line = Line(7)
    line.link.spoil = line.spoil
    line.gate.control.take(EVA, "m1")
    outcomes: dict[str, int] = {}
    for number in range(writes):
        value = round(line.chance.uniform(0.1, 3000.0), 1)
        before = len(line.link.writes)
        try:
            nonce = line.gate.nonces.issue(EVA.session)
            line.clock.advance(0.25)
            await line.gate.set_value(EVA, "m1", "f114", value, nonce=nonce, confirmed=True)
            asked, acted = len(line.link.writes), line.acted
            assert asked == before + 1
        except Refused as refused:
            outcomes[refused.reason] = outcomes.get(refused.reason, 0) + 1
            continue
        for _ in range(20):
            progress = line.gate.progress("m1")
            assert progress is not None
            if progress.over:
                break
            line.clock.advance(0.9)
            line.publish("m1", Scan.ONCE)
            line.gate.tick()
            await settle()
        assert progress.over, progress
        assert len(line.link.writes) == asked, "a command was sent again"
        if progress.state == "confirmed":
            assert acted, (number, progress)
            assert line.drive()["f114"] == value, (number, progress)
        outcomes[progress.state] = outcomes.get(progress.state, 0) + 1
    assert sum(outcomes.values()) == writes
    assert outcomes["confirmed"] > 0.3 * writes  # what arrived is told as arrived
    assert outcomes["unconfirmed"] > 0.1 * writes
    assert len(line.commands) == writes
