"""Both databases, for tests that do something to their files."""

from typing import Literal

Name = Literal["pogon", "history"]
TABLE: dict[Name, str] = {"pogon": "retained (id, state)", "history": "mark (name, t)"}
"""Into which a test may write."""
