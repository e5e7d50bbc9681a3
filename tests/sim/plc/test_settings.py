"""Settings are taken all or none, and only as they were staged."""

from struct import pack, unpack
from zlib import crc32

import pytest

from app.registers.plc_map import COMMIT_SETTINGS, AnswerState, Request
from app.sim.plc.settings import Setting, Settings
from app.sim.plc.verdict import REASON_COUNT, REASON_CRC, REASON_VALUE

THREE = (Setting("a", 0.1, 0.1, 0.3), Setting("b", 5.0, -10.0, 10.0), Setting("c", 0.0, 0.0, 1e6))


def words(*values: float) -> list[int]:
    return list(unpack(f">{2 * len(values)}H", pack(f">{len(values)}f", *values)))


def request(settings: Settings, count: int | None = None, crc: int | None = None) -> Request:
    staged = pack(f">{settings.words}H", *settings.staged)
    arguments = (settings.words if count is None else count, crc32(staged) if crc is None else crc, 0, 0)
    return Request(COMMIT_SETTINGS, 0, 0, arguments, 1)


@pytest.mark.parametrize(
    ("values", "wrong"),
    [
        ((0.1, -10.0, 0.0), 0),
        ((0.3, 10.0, 1e6), 0),
        ((0.09, 0.0, 0.0), 1),
        ((0.31, 0.0, 0.0), 1),
        ((0.2, 10.1, 0.0), 2),
        ((0.2, 0.0, -0.1), 3),
        ((0.2, float("nan"), 0.0), 2),
        ((float("inf"), 0.0, 0.0), 1),
        ((0.4, 99.0, -1.0), 1),
    ],
)
def test_limits_hold_as_float32_and_the_first_wrong_one_is_named(values: tuple[float, ...], wrong: int) -> None:
    settings = Settings(THREE)
    before, generation = settings.values, settings.generation
    settings.stage(0, words(*values))
    verdict = settings.commit(request(settings), lambda taken: 0)
    if wrong:
        assert (verdict.state, verdict.reason, verdict.detail) == (AnswerState.REJECTED, REASON_VALUE, wrong)
        assert (settings.values, settings.generation) == (before, generation)
    else:
        assert verdict.state is AnswerState.DONE
        assert list(settings.values.values()) == list(unpack(">3f", pack(">3f", *values)))
        assert settings.generation == generation + 2


@pytest.mark.parametrize(
    ("count", "crc", "reason"), [(5, None, REASON_COUNT), (None, 1, REASON_CRC), (0, 1, REASON_COUNT)]
)
def test_another_count_or_check_sum_takes_none(count: int | None, crc: int | None, reason: int) -> None:
    settings = Settings(THREE)
    settings.stage(2, words(7.0))
    assert settings.commit(request(settings, count, crc), lambda taken: 0).reason == reason
    assert settings.values["b"] == 5.0


def test_the_machine_may_refuse_what_does_not_go_together() -> None:
    settings = Settings(THREE)
    settings.stage(2, words(7.0))
    verdict = settings.commit(request(settings), lambda taken: 2 if taken["b"] > 6 else 0)
    assert (verdict.reason, verdict.detail, settings.values["b"]) == (REASON_VALUE, 2, 5.0)


def test_a_power_cycle_forgets_what_was_staged_and_keeps_what_is_in_effect() -> None:
    settings = Settings(THREE)
    settings.stage(2, words(7.0))
    settings.commit(request(settings), lambda taken: 0)
    settings.stage(2, words(8.0))
    settings.start_up()
    assert settings.staged[2:4] == words(7.0)
    assert list(settings.image) == [3, *settings.staged, 0]
    settings.clear()
    assert (settings.values["b"], settings.generation) == (5.0, 0)
