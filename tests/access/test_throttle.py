"""The brakes on guessing grow, never lock for good, and hit nobody else."""

from app.access.throttle import BUCKET, MOST_KEPT, Throttle
from app.clock import ManualClock


def test_delays_double_after_five_failures_up_to_a_minute() -> None:
    clock = ManualClock()
    throttle = Throttle(clock)
    delays = []
    for _ in range(13):
        delays.append(throttle.failed("ana"))
        clock.advance(throttle.wait("ana"))
    assert delays == [0, 0, 0, 0, 1, 2, 4, 8, 16, 32, 60, 60, 60]


def test_another_account_is_not_hit() -> None:
    throttle = Throttle(ManualClock())
    for _ in range(9):
        throttle.failed("ana")
    assert throttle.wait("ana") > 0
    assert throttle.wait("marko") == 0


def test_success_and_an_hour_of_quiet_forget() -> None:
    clock = ManualClock()
    throttle = Throttle(clock)
    for name in ("ana", "marko"):
        for _ in range(9):
            throttle.failed(name)
    throttle.clear("ana")
    assert throttle.failed("ana") == 0
    clock.advance(3601)
    assert throttle.failed("marko") == 0


def test_an_address_has_twenty_attempts_and_gets_twenty_a_minute() -> None:
    clock = ManualClock()
    throttle = Throttle(clock)
    assert [throttle.take("10.0.0.9") for _ in range(BUCKET + 2)] == [True] * BUCKET + [False, False]
    assert throttle.take("10.0.0.10")
    clock.advance(3.1)
    assert [throttle.take("10.0.0.9"), throttle.take("10.0.0.9")] == [True, False]
    clock.advance(600)
    assert sum(throttle.take("10.0.0.9") for _ in range(50)) == BUCKET


def test_the_addresses_of_one_client_share_their_attempts() -> None:
    throttle = Throttle(ManualClock())
    ours = [throttle.take(f"2001:db8:0:1::{number:x}") for number in range(BUCKET + 5)]
    assert ours == [True] * BUCKET + [False] * 5
    assert throttle.take("2001:db8:0:2::1")
    throttle.give_back("2001:db8:0:1:ffff::")
    assert [throttle.take("2001:db8:0:1:8::"), throttle.take("2001:db8:0:1:9::")] == [True, False]
    old = [throttle.take(address) for address in ["192.0.2.7", "::ffff:192.0.2.7"] * 15]
    assert old == [True] * BUCKET + [False] * 10
    assert throttle.take("192.0.2.8")


def test_memory_is_bounded() -> None:
    throttle = Throttle(ManualClock())
    for number in range(MOST_KEPT + 500):
        throttle.failed(f"name{number}")
        throttle.take(f"address{number}")
    assert len(throttle._accounts) == len(throttle._buckets) == MOST_KEPT
