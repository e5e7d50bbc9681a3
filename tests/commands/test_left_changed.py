"""A server that is killed while somebody jogs: the drive's changed frequency is told after the restart and put back on one press."""

import json
import shutil
from pathlib import Path

import pytest

from app.access.audit.line import Record
from app.commands.left_changed import left_changed
from app.commands.lifecycle import ProgressState
from app.errors import Refused
from app.plant.loader import read_plant
from app.runtime import Runtime
from app.settings import Settings
from app.sim.eura_e800.drive import VirtualE800
from tests.commands.test_open_sets import EVA, runtime_of
from tests.demo_plant import DEMO, plant_folder
from tests.virtual import VirtualClient, house

F113, LOCK = 0x010D, 0x2001


def drive(runtime: Runtime) -> VirtualE800:
    assert runtime.sim is not None
    found = runtime.sim.devices["m2"]
    assert isinstance(found, VirtualE800)
    return found


def jogged(browser: VirtualClient, seconds: float) -> None:
    """m2 is jogged: held up to 1.05 s, then let go, `seconds` after the press."""
    runtime = runtime_of(browser)
    gate = runtime.gate
    assert gate is not None
    gate._state.rights = gate._state.checks._rights = gate._state.control._rights = lambda person: person

    async def arm() -> str:
        gate.control.take(EVA, "m2")
        return await gate.hold.arm(EVA, "m2", "jog_forward", nonce=gate.nonces.issue(EVA.session))

    async def hold(lease: str, counter: int) -> None:
        gate.hold.keep_alive(lease, counter, EVA.session)

    async def release(lease: str) -> None:
        gate.hold.release(lease, EVA.session)

    lease, left = browser.run(arm()), seconds
    for counter in range(1, 8):
        browser.run(hold(lease, counter))
        browser.pass_time(min(0.15, left))
        left -= 0.15
        if left <= 0:
            return
    browser.run(release(lease))
    browser.pass_time(left)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("seconds", "stays"), [(0.01, True), (0.6, True), (1.1, True), (2.0, True), (3.05, True), (9.0, False)]
)
def test_what_a_killed_server_left_changed_is_told_and_put_back_on_one_press(
    tmp_path: Path, seconds: float, stays: bool
) -> None:
    left, plant = tmp_path / "left", plant_folder(tmp_path / "plant", "m1", "m2")
    with house(Settings(plant=plant, data=tmp_path / "data")) as browser:
        browser.pass_time(5)
        worn = drive(runtime_of(browser)).memory.eeprom_writes
        jogged(browser, seconds)
        shutil.copytree(tmp_path / "data", left, ignore=shutil.ignore_patterns("server.socket", "*.lock"))
        browser.pass_time(12)
        device = drive(runtime_of(browser))
        assert device.parameter("F113") == 50.0 and device.memory.eeprom_enabled and device.memory.eeprom_writes == worn
    with house(Settings(plant=plant, data=left)) as browser:
        runtime = runtime_of(browser)
        device, gate = drive(runtime), runtime.gate
        assert gate is not None
        device.write(6, LOCK, [4])
        device.write(6, F113, [500])  # the drive itself had gone on
        browser.pass_time(6)
        assert device.parameter("F113") == 5.0, "nothing is written by itself"
        alarms = {one.key: one.state for one in runtime.alarms.list.active() if one.equipment == "m2"}
        assert (gate.left("m2") == {"frequency_setpoint": 50.0}) is stays
        assert ("left_changed" in alarms) is stays
        if not stays:
            return
        gate._state.rights = gate._state.checks._rights = gate._state.control._rights = lambda person: person

        async def press(command: str, **more: object) -> object:
            gate.control.take(EVA, "m2")
            nonce = gate.nonces.issue(EVA.session)
            return await gate.ask(EVA, "m2", command, nonce=nonce, confirmed=True, **more)  # type: ignore[arg-type]

        for command, more in (("forward", {}), ("set_frequency", {"argument": 30})):
            with pytest.raises(Refused) as refused:
                browser.run(press(command, **more))
            assert refused.value.reason == "why.left_changed"
        browser.run(press("put_back"))
        browser.pass_time(3)
        told = gate.progress("m2")
        assert told is not None and (told.command, told.state) == ("put_back", ProgressState.CONFIRMED)
        assert device.parameter("F113") == 50.0 and device.memory.eeprom_enabled
        assert gate.left("m2") == {}
        alarms = {one.key: one.state for one in runtime.alarms.list.active() if one.equipment == "m2"}
        assert alarms["left_changed"] == "D", "gone, and waits to be acknowledged"
        with pytest.raises(Refused) as refused:
            browser.run(press("put_back"))
        assert refused.value.reason == "why.nothing_left"
    with house(Settings(plant=plant, data=left)) as browser:
        browser.pass_time(3)
        gate = runtime_of(browser).gate
        assert gate is not None and gate.left("m2") == {}, "told once"


def line(seq: int, object: str, result: str = "sent", former: object = None) -> Record:
    kind = "command.sent" if result == "sent" else "command"
    params = json.dumps({"id": str(seq)} | ({"former": json.dumps(former)} if former is not None else {}))
    return Record(seq, kind, 1, "eva", "", "", object, "", "", result, "", params, seq)


JOG = {"frequency_setpoint": 40.0}


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("told", "expected"),
    [
        ([], {}),
        ([line(1, "m1.jog_forward", former=JOG)], {"m1": JOG}),
        ([line(2, "m1.jog_forward", "confirmed", JOG), line(1, "m1.jog_forward", former=JOG)], {"m1": JOG}),
        ([line(2, "m1.put_back", "confirmed"), line(1, "m1.jog_forward", former=JOG)], {}),
        ([line(2, "m1.put_back", "unconfirmed"), line(1, "m1.jog_forward", former=JOG)], {"m1": JOG}),
        ([line(2, "m2.put_back", "confirmed"), line(1, "m1.jog_forward", former=JOG)], {"m1": JOG}),
        ([line(3, "m1.jog_reverse", former=JOG), line(2, "m1.put_back", "confirmed")], {"m1": JOG}),
        (
            [line(2, "m1.jog_reverse", former={"frequency_setpoint": 5.0}), line(1, "m1.jog_forward", former=JOG)],
            {"m1": JOG},
        ),
        ([line(1, "m1.jog_forward")], {}),
        ([line(1, "m1.forward", former=JOG)], {}),
        ([line(1, "gone.jog_forward", former=JOG)], {}),
        ([line(1, "m1.jog_forward", former={"gone": 1.0})], {}),
        ([line(1, "m1.jog_forward", former=[1])], {}),
        ([line(1, "m1.jog_forward", former={"frequency_setpoint": "?"})], {}),
        ([line(1, "rubbish", former=JOG)], {}),
    ],
)
def test_left_is_what_a_motion_changed_and_nobody_gave_back(
    told: list[Record], expected: dict[str, dict[str, float]]
) -> None:
    plant, _ = read_plant(DEMO)
    assert plant is not None
    assert left_changed(told, plant.equipment) == expected
