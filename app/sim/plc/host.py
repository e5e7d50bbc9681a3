"""Whether the host is alive: its heartbeat must change within a time-out that is above 0."""


class HostWatch:
    """The heartbeat that the host wrote last, and for how long it stood still."""

    def __init__(self) -> None:
        self.start_up()

    def start_up(self) -> None:
        """The host has just been heard."""
        self.heartbeat = 0
        self.silent = False
        """Whether it stood still for longer than the time-out."""
        self._age = 0.0

    def take(self, heartbeat: int) -> None:
        """The host wrote its heartbeat."""
        if heartbeat != self.heartbeat:
            self._age, self.heartbeat = 0.0, heartbeat

    def step(self, dt: float) -> None:
        """`dt` [s] pass."""
        self._age += dt

    def judge(self, timeout: float) -> None:
        """Look whether it is silent; `timeout` [s], 0 = it is not watched."""
        self.silent = timeout > 0 and self._age > timeout + 1e-9
