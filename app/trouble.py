"""What goes wrong again and again, as it is told: when it begins or has another cause, and when it is over."""


class Trouble:
    """Of one thing that is tried again and again."""

    def __init__(self) -> None:
        self._cause = ""

    def is_news(self, cause: str) -> bool:
        """It went wrong because of `cause`; whether that is to be told, as it was not the cause the last time."""
        before, self._cause = self._cause, cause
        return cause != before

    def is_over(self) -> bool:
        """It went well; whether that is to be told, as it did not the last time."""
        before, self._cause = self._cause, ""
        return bool(before)
