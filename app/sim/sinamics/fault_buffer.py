"""The fault buffer of a SINAMICS drive (r0947): situations of faults, each closed by an acknowledgement."""

SITUATIONS, PLACES = 8, 8
"""So many situations of so many faults."""


class FaultBuffer:
    """Numbers by situation, the present one first; 0 = none."""

    def __init__(self) -> None:
        """No fault ever."""
        self.situations = [[0] * PLACES for _ in range(SITUATIONS)]
        self.new: list[int] = []
        """Entered since the drive last reacted."""

    @property
    def present(self) -> list[int]:
        """Places of the present situation."""
        return self.situations[0]

    @property
    def standing(self) -> list[int]:
        """Faults that stand."""
        return [number for number in self.present if number]

    def enter(self, number: int) -> None:
        """A fault comes: into the next free place, or over the last one; one that stands already is not entered again."""
        if number in self.present:
            return
        place = self.present.index(0) if 0 in self.present else PLACES - 1
        self.present[place] = number
        self.new.append(number)

    def take_new(self) -> list[int]:
        """What was entered since the last call."""
        new, self.new = self.new, []
        return new

    def acknowledge(self) -> None:
        """Situations move on by one, the last is forgotten; nothing happens where none is open."""
        if any(self.present):
            self.situations = [[0] * PLACES, *self.situations[:-1]]
