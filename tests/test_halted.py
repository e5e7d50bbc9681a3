"""A PLC whose program stands while it answers, seen by the whole house: one alarm, and a reason for whoever operates."""

from pathlib import Path

import pytest

from app.tags.quality import QualityReason, reason
from tests.commands.stand import ANA
from tests.reloading import running


@pytest.mark.sweep(8)
async def test_it_raises_one_alarm_per_unit_refuses_with_its_reason_and_clears_by_itself(tmp_path: Path) -> None:
    async with running(tmp_path) as plant:
        runtime = plant.runtime
        gate, sim = runtime.gate, runtime.sim
        assert gate is not None and sim is not None

        def alarms() -> list[str]:
            standing = [one for one in runtime.alarms.list.active() if one.life.active]
            return sorted(one.id for one in standing if "program_halted" in one.id)

        await plant.until(lambda: all(plant.good(f"{name}.state") for name in ("c1", "cc1", "seq1")))
        device = sim.devices["c1"]
        step, device.step = device.step, lambda: None  # type: ignore[method-assign]
        await plant.until(lambda: alarms() == ["sys.program_halted.c1"])
        assert reason(runtime.tags.sample("c1.state").quality) is QualityReason.HALTED
        for name, command in runtime.plant.equipment["c1"].type.commands.items():  # type: ignore[union-attr]
            told = [found.key for found in gate.why_not(ANA, "c1", command.key)]
            assert ("why.program_halted" in told) is not command.stop, (name, told)
            assert not {"why.poor_value", "why.old_value"} & set(told), (name, told)
        assert plant.good("cc1.state") and plant.good("m1.frequency"), "its neighbours do not suffer"
        device.step = step  # type: ignore[method-assign]
        await plant.until(lambda: not alarms() and plant.good("c1.state"))
        journal = [one for one in runtime.alarms.list.active() if "program_halted" in one.id]
        assert all(one.count == 1 for one in journal)
