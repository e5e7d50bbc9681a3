"""How alarms are written: durations as a clock, bars that hold every time once."""

from app.web.alarm_view import bars, lasting


def test_durations_are_written_as_a_clock() -> None:
    assert [lasting(seconds) for seconds in (-1, 6, 75, 3725, 90061)] == [
        "00:00",
        "00:06",
        "01:15",
        "1:02:05",
        "1\u00a0d 01:01",
    ]


def test_bars_hold_every_time_once() -> None:
    hour = 3_600_000_000
    assert bars([0, 1, hour - 1, hour, 5 * hour], 5 * hour, hour, 6) == [1, 3, 0, 0, 0, 1]
    assert sum(bars([-hour, 0], 5 * hour, hour, 5)) == 0
