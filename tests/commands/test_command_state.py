"""Commands of a machine stand in one place: a newer one supersedes, a Stop is one Stop."""

from app.commands.lifecycle import ProgressState
from app.errors import NoAnswer
from tests.commands.stand import ANA, Stand


async def test_a_newer_command_supersedes_the_pending_one() -> None:
    stand = Stand()
    stand.drives["m1"].deaf = True
    await stand.ask(ANA, "forward")
    await stand.ask(ANA, "reverse")
    assert [(line.object, line.result) for line in stand.commands] == [("m1.forward", "superseded")]
    assert stand.gate.progress("m1").command == "reverse"  # type: ignore[union-attr]


async def test_pressing_stop_again_does_not_put_the_alarm_off() -> None:
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0)
    stand.link.spoil = lambda *telegram: NoAnswer("silence")
    for _ in range(4):
        await stand.ask(ANA, "stop")
        await stand.pass_time(3, until=lambda: stand.alarms)
    assert stand.alarms == ["m1"]


async def test_coasting_may_be_asked_again_at_once() -> None:
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0)
    for _ in range(3):
        assert (await stand.ask(ANA, "coast")).state is ProgressState.ACCEPTED
        await stand.pass_time(0.2)


async def test_subscribers_hear_of_progress_and_reasons_at_most_ten_times_a_second() -> None:
    stand = Stand()
    await stand.pass_time(1)
    told: list[str] = []
    ends: list[str] = []
    end = stand.gate.subscribe(told.append)
    stand.gate.subscribe_ends(lambda progress: ends.append(progress.command))
    await stand.pass_time(3)
    assert told == []
    stand.set_drive(status=9)
    await stand.pass_time(0.5)
    assert told == ["m1"]
    told.clear()
    stand.set_drive(status=0)
    await stand.ask(ANA, "forward")
    await stand.pass_time(1)
    assert 1 <= len(told) <= 10
    assert ends == ["forward"]
    end()
    told.clear()
    await stand.ask(ANA, "stop")
    await stand.pass_time(1)
    assert told == []


async def test_subscribers_hear_that_the_simulation_is_paused_and_that_it_goes_on() -> None:
    """A page that was opened in a pause refused every command after it, with the pause as the reason."""
    stand = Stand()
    await stand.pass_time(1)
    told: list[str] = []
    stand.gate.subscribe(told.append)
    for paused in (True, False):
        told.clear()
        stand.link.paused = paused
        await stand.pass_time(1)
        assert set(told) == set(stand.plant.equipment), paused
        assert len(told) == len(stand.plant.equipment), paused
