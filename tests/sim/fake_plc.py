"""A Pogon PLC and nothing behind it: a counter that a command sets, two settings, a table that a command fills."""

from struct import pack

from app.registers.plc_map import AnswerState, Request
from app.sim.plc import Image, Setting, Table, Verdict, VirtualPlc, rejected

STATUS, CONFIGURATION, SETTINGS, STAGING, TABLE = 0x0100, 0x0180, 0x0200, 0x0240, 0x0800
SET, ADD, REMOVE, RUN, FAIL = 1, 2, 3, 4, 5
CHANGED, POWER_UP, ADDED = 38, 34, 8


class FakePlc(VirtualPlc):
    """Status: counter u32, state, counts per scan f32. Command 1 sets the counter, 2 adds a row, 3 removes one, 4 runs 10 scans."""

    type = "fake_plc"
    TYPE_CODE = 99

    def __init__(self, *, slots: int = 7) -> None:
        self.table = Table(TABLE, 8, slots, self._row)
        super().__init__(
            settings=(Setting("rate", 1.0, 0.0, 10.0), Setting("timeout", 0.0, 0.0, 60.0)),
            settings_at=SETTINGS,
            staging_at=STAGING,
            images=(
                Image(STATUS, 10, lambda: pack(">IHfHHH", self.counter, self.state, self.settings["rate"], 0, 0, 0)),
                Image(CONFIGURATION, 4, lambda: pack(">HH", slots, 0)),
            ),
            configuration=CONFIGURATION,
            tables=(self.table,),
            capacities=(slots,),
            faults=(1,),
        )
        self._start_up()

    @property
    def state(self) -> int:
        return 1 if self.counter >= 100 else 2

    @property
    def host_timeout(self) -> float:
        return self.settings["timeout"]

    def _scan(self) -> None:
        self.counter += 1
        if self.hold:
            self.held += 1

    def _execute(self, request: Request) -> Verdict:
        if request.code == SET:
            self.counter = request.arguments[0]
        elif request.code == ADD:
            if (slot := self.table.take(request.arguments[0])) is None:
                return rejected(10)
            self.event(ADDED, source=slot, value=request.arguments[0])
            return Verdict(detail=slot)
        elif request.code == REMOVE:
            self.table.free(request.arguments[0])
        elif request.code in (RUN, FAIL):
            end, ends = self.steps + 10, AnswerState.DONE if request.code == RUN else AnswerState.FAILED
            return Verdict(AnswerState.RUNNING, until=lambda: ends if self.steps >= end else AnswerState.RUNNING)
        else:
            return rejected(1)
        return Verdict()

    def _settings_changed(self) -> None:
        self.event(CHANGED)

    def _power_up(self) -> None:
        self.counter = 0
        self.held = 0
        self.event(POWER_UP, value=self.boots)

    def _forget(self) -> None:
        pass

    def _row(self, slot: int) -> bytes:
        id = self.table.ids[slot]
        return pack(">IHHfHH", id, self.generation, 1 if id else 0, 1.5 * slot, 0, self.generation)
