"""What fails again and again is told when it begins, when its cause is another one, and when it is over."""

from app.trouble import Trouble


def test_each_cause_is_told_once_and_the_end_once() -> None:
    trouble = Trouble()
    assert not trouble.is_over()
    assert [trouble.is_news(cause) for cause in ("full", "full", "gone", "full", "full")] == [
        True,
        False,
        True,
        True,
        False,
    ]
    assert [trouble.is_over(), trouble.is_over()] == [True, False]
    assert trouble.is_news("full")
