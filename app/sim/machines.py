"""Every machine that can be simulated: each folder here is one, named after its equipment type.

Its package holds `build`, which makes the virtual device of an equipment (`sim/device.py` says what that is), and `FAULTS`, the status
codes that it takes as a machine fault; one that takes none has no `FAULTS`.
A folder without `build` is mechanics that have no registers yet. A type whose data describes its machine (`simulation.toml`) needs none.
"""

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pkgutil import iter_modules

from app.plant.definitions import Equipment
from app.sim.described.device import describe
from app.sim.device import VirtualDevice

Factory = Callable[[Equipment, int], VirtualDevice]
"""(equipment, seed) → its virtual device."""

_FOLDERS = (
    import_module(f"{__package__}.{found.name}")
    for found in iter_modules([*import_module(__package__).__path__])
    if found.ispkg
)
_PACKAGES = {package.__name__.rpartition(".")[2]: package for package in _FOLDERS if hasattr(package, "build")}
VIRTUAL_DEVICES: dict[str, Factory] = {name: package.build for name, package in _PACKAGES.items()}
"""Equipment type → what builds its virtual device."""
MACHINE_FAULTS: Mapping[str, Sequence[int]] = {
    name: tuple(getattr(package, "FAULTS", ())) for name, package in _PACKAGES.items()
}
"""Equipment type → the status codes that its virtual device takes as a machine fault (0xE010)."""


def factory_of(item: Equipment, factories: Mapping[str, Factory] = VIRTUAL_DEVICES) -> Factory | None:
    """What builds the virtual device of a machine: one of ours, or what its type describes; None: nothing does."""
    return factories.get(item.type.name) or (describe if item.type.simulation else None)
