"""How much longer a rope is under its load: the encoder of the drum does not see it."""

from math import isfinite


def stretch(load: float, length: float, strain: float) -> float:
    """Stretch of a rope of `length` [mm] under `load` [1 = full load], which at full load is `strain` of its length [mm].

    Below no load and no length there is none.

    Raises:
        ValueError: one of them is not finite.

    Source: Hooke's law; strain = stress / modulus of the rope.
    """
    for name, value in (("load", load), ("length", length), ("strain", strain)):
        if not isfinite(value):
            raise ValueError(f"{name} is {value}, a finite number expected")
    return max(0.0, load) * max(0.0, length) * strain
