"""The fault buffer from the parameters that hold it: situations, places, and which times can be told."""

from app.profidrive.fault_buffer import Columns, Moment, alarms, situations


def column(**at: int) -> list[int]:
    """64 elements, `_8=7452` sets element 8."""
    found = [0] * 64
    for place, value in at.items():
        found[int(place[1:])] = value
    return found


def test_faults_stand_in_their_situations_with_their_times_and_values() -> None:
    found = situations(
        Columns(
            column(_0=7452, _1=30021, _8=7860, _63=1910),
            column(_0=9000, _1=9500, _8=4000, _63=100),
            column(_8=6000, _63=200),
            column(_0=-5, _63=3),
        ),
        10_000,
    )
    assert [[one.number for one in messages] for messages in found] == [
        [7452, 30021],
        [7860],
        [],
        [],
        [],
        [],
        [],
        [1910],
    ]
    first, oldest = found[0][0], found[7][0]
    assert (first.value, first.received, first.removed) == (-5, Moment(0, 9000, 1000), None)
    assert (found[1][0].received, found[1][0].removed) == (Moment(0, 4000, 6000), Moment(0, 6000, 4000))
    assert (oldest.value, oldest.received, oldest.removed) == (3, Moment(0, 100, 9900), Moment(0, 200, 9800))


def test_a_time_has_an_age_only_where_the_runtime_leads_there() -> None:
    numbers = column(_0=1, _8=2, _16=3, _24=4)
    times = column(_0=5000, _8=8000, _16=3000)  # 8000 is before the runtime began anew, so what is older is, too

    def ages(runtime: int | None, columns: Columns) -> list[int | None]:
        return [one.received.age if one.received else -1 for part in situations(columns, runtime) for one in part]

    assert ages(10_000, Columns(numbers, times)) == [5000, None, None, -1]
    assert ages(None, Columns(numbers, times)) == [None, None, None, -1]
    assert ages(4000, Columns(numbers, times)) == [None, None, None, -1]
    days = Columns(numbers, times, received_days=column(_0=12))
    assert ages(10_000, days)[0] is None and situations(days, 10_000)[0][0].received == Moment(12, 5000)
    removed = situations(Columns(numbers, column(_0=0), column(_8=100)), 10_000)[1][0]
    assert removed.received is None and removed.removed == Moment(0, 100)


def test_what_a_drive_does_not_have_is_not_told() -> None:
    (only,) = situations(Columns([7452]), 100)
    assert [(one.number, one.value, one.received, one.removed) for one in only] == [(7452, None, None, None)]
    assert situations(Columns(()), 100) == [] and len(situations(Columns([0] * 80), 100)) == 8
    active = alarms(Columns([7910, 0, *[0] * 6, 5000], [50]), 60)
    assert [(one.number, one.received) for one in active] == [(7910, Moment(0, 50, 10))]
