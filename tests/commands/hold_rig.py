"""A button that is held."""

from tests.commands.stand import ANA, Stand


class Pressed:
    """A person at a button: presses, holds for a time, lets go."""

    def __init__(self, stand: Stand, command: str = "jog_forward") -> None:
        self.stand = stand
        self.command = command
        self.lease = ""
        self.counter = 0

    async def arm(self, **asked: object) -> "Pressed":
        gate = self.stand.gate
        gate.control.take(ANA, "m1")
        asked.setdefault("nonce", gate.nonces.issue(ANA.session))
        self.lease = await gate.hold.arm(ANA, "m1", self.command, **asked)  # type: ignore[arg-type]
        return self

    async def hold(self, seconds: float) -> None:
        for _ in range(max(1, round(seconds / 0.15))):
            self.counter += 1
            self.stand.gate.hold.keep_alive(self.lease, self.counter, ANA.session)
            await self.stand.pass_time(0.15)

    def release(self) -> None:
        self.stand.gate.hold.release(self.lease, ANA.session)


def moving(stand: Stand) -> bool:
    return stand.drive()["status"] in (1, 2)
