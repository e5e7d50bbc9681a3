"""Mistakes in a plant folder, as they are told."""

from dataclasses import dataclass

from app.plant.said import said


@dataclass(frozen=True, slots=True)
class Problem:
    """One mistake in a plant folder."""

    file: str
    key: str
    value: str
    expected: str
    line: int | None = None

    def __str__(self) -> str:
        where = f"{self.file}:{self.line}" if self.line else self.file
        return f"{where}: {self.key} = {self.value}: expected {self.expected}"


class MoreProblems(Problem):
    """In place of those that are not told one by one."""

    def __init__(self, number: int, *, stopped: bool) -> None:
        super().__init__(
            "", "", said("mistake.more", number=number), said(f"mistake.none{'_further' if stopped else ''}")
        )

    def __str__(self) -> str:
        return f"and {self.value}" + (", and the rest of the file was not read" if "further" in self.expected else "")
