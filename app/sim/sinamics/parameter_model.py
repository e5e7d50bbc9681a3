"""What the virtual drive does with a parameter request: every parameter in its RAM, what was saved in its ROM, what it shows of itself.

What no source tells:

| subject | taken here |
| --- | --- |
| order of the checks | drive object, number, access, index, type, number of values, limits, permitted values, operating state |
| scalar asked for with an index or as several elements | 0x04; an index that an array lacks: 0x03 with it |
| type of a written value | that of the parameter, or byte, word and double word for unsigned ones of their size |
| commissioning | p0010 other than 0; it does not keep the drive from being switched on |
| interconnection (BICO) | kept without effect; one that names no parameter of the list: 0x83 |
| p0340 | calculates nothing, and reads 0 again |
| saving | takes 0.5 s, p0971 and p0977 read 1 meanwhile; both save everything |
| faults and alarms of the Control Unit | a buffer of its own, in which nothing ever comes |
| values of different parameters | do not depend on each other |
"""

from collections.abc import Callable, Mapping, MutableMapping, Sequence
from typing import Any

from app.profidrive.parameter_access.error_numbers import ErrorNumber
from app.profidrive.parameter_access.formats import LAYOUTS, Format, rounded
from app.profidrive.parameter_access.messages import Address, Attribute, Failed, Request, Result, Values, Written
from app.profidrive.parameter_access.parameter import DriveParameter, When
from app.profidrive.parameter_access.source import names_known

SAVE_TIME = 0.5
"""[s]"""
SAVES = ("p0971", "p0977")
FLOAT_STEP = 1e-6
"""So much of a value may be lost in a Float32."""
COMMISSIONING = "p0010"
RAW = {1: Format.BYTE, 2: Format.WORD, 4: Format.DOUBLE_WORD}
CLEARS, ACKNOWLEDGES = "p0952", "p3981"

MESSAGES, CONTROL_UNIT = "messages", 1
"""Group of the parameters of which every drive object has its own; the drive object that is no axis."""

Live = Callable[[str], Sequence[float] | None]
"""Code → what the drive shows at this moment, from its first element on; None = nothing of its own."""


class ParameterModel:
    """The parameters of one drive."""

    def __init__(
        self,
        parameters: Mapping[str, DriveParameter],
        shared: MutableMapping[str, float],
        live: Live,
        *,
        pulses: Callable[[], bool],
        act: Callable[[str], None],
        objects: Sequence[int] = (1, 2),
        initial: Mapping[str, Sequence[float]] | None = None,
    ) -> None:
        """`shared`: values that the drive itself works with; `act`: tells the drive to do what writing a code means; `objects`: with one
        of them only, it has everything; `initial`: as commissioned."""
        self._parameters = parameters
        self._by_number = {one.number: one for one in parameters.values()}
        self._shared = shared
        self._live = live
        self._pulses = pulses
        self._act = act
        self._objects = tuple(objects)
        self._ram = {code: [one.default] * one.elements for code, one in parameters.items() if one.writable}
        for code, values in (initial or {}).items():
            if code in self._ram:
                self._ram[code][: len(values)] = values
        self._rom = self._commissioned = self._copy()
        self._saving = 0.0
        self.saves = 0
        """How often its ROM was written, or taken over, since it was commissioned."""

    @property
    def saving(self) -> bool:
        """Whether RAM is being copied to ROM."""
        return self._saving > 0

    def step(self, dt: float) -> None:
        """One step of `dt` [s]: what is being saved is saved in the end."""
        if self._saving > 0:
            self._saving -= dt
            if self._saving <= dt / 2:
                self._saving = 0.0
                self._rom = self._copy()
                self.saves += 1

    def power_up(self) -> None:
        """What was not saved is forgotten; a save that was not over saved nothing."""
        self._saving = 0.0
        ram, shared = self._rom
        self._ram = {code: list(values) for code, values in ram.items()}
        self._shared.update(shared)

    def rom(self) -> dict[str, Any]:
        """What was saved, with what it was commissioned with, as JSON holds it; nothing where nothing was saved yet."""
        return {"saved": _whole(self._rom), "commissioned": _whole(self._commissioned)} if self.saves else {}

    def load(self, rom: Mapping[str, Any]) -> bool:
        """Take over what `rom` gave before; false, and nothing is taken, where that does not fit: it is of a drive that was commissioned
        otherwise, or not of this kind. A parameter that it does not know keeps its value."""
        saved, former = rom.get("saved"), rom.get("commissioned")
        if not isinstance(saved, Mapping) or not isinstance(former, Mapping):
            return False
        now = _whole(self._commissioned)
        if any(code in now and now[code] != values for code, values in former.items()):
            return False
        if not all(self._fits(code, values) for code, values in saved.items() if code in now):
            return False
        ram, shared = self._copy()
        for code in saved.keys() & now.keys():
            if code in shared:
                shared[code] = float(saved[code][0])
            else:
                ram[code] = [float(value) for value in saved[code]]
        self._rom = ram, shared
        self.saves += 1
        return True

    def _fits(self, code: str, values: object) -> bool:
        one = self._parameters[code]
        if not isinstance(values, list) or len(values) != one.elements:
            return False
        low, high = one.low - FLOAT_STEP * abs(one.low), one.high + FLOAT_STEP * abs(one.high)
        return all(isinstance(value, int | float) and low <= value <= high for value in values)

    def values(self, code: str) -> list[float]:
        """Every element of a parameter at this moment [its unit]."""
        parameter = self._parameters[code]
        if code in self._shared:
            return [self._shared[code]]
        if code in SAVES:
            return [float(self.saving)]
        live = self._live(code)
        if live is None:
            live = self._ram.get(code, ())
        return [*live, *(0.0,) * parameter.elements][: parameter.elements]

    def numbers(self, drive_object: int) -> list[int]:
        """Numbers of the parameters of a drive object."""
        return sorted(one.number for one in self._parameters.values() if self._has(drive_object, one))

    def serve(self, request: Request) -> list[Result]:
        """The result of every parameter of `request`, which acts in its order."""
        if request.values is None:
            return [self._read(request.drive_object, address) for address in request.addresses]
        pairs = zip(request.addresses, request.values, strict=True)
        return [self._write(request.drive_object, address, block) for address, block in pairs]

    def _has(self, drive_object: int, parameter: DriveParameter) -> bool:
        return len(self._objects) == 1 or drive_object in parameter.objects

    def _found(self, drive_object: int, address: Address) -> DriveParameter | Failed:
        if drive_object not in self._objects:
            return Failed(ErrorNumber.NO_DRIVE_OBJECT)
        parameter = self._by_number.get(address.number)
        if parameter is None or not self._has(drive_object, parameter):
            return Failed(ErrorNumber.NO_PARAMETER)
        return parameter

    def _read(self, drive_object: int, address: Address) -> Result:
        parameter = self._found(drive_object, address)
        if isinstance(parameter, Failed):
            return parameter
        if address.attribute is not Attribute.VALUE:
            described = address.attribute is Attribute.DESCRIPTION
            return Failed(ErrorNumber.NO_DESCRIPTION if described else ErrorNumber.NO_TEXT)
        if (wrong := _wrong_index(parameter, address)) is not None:
            return wrong
        values = self._values_in(drive_object, parameter)
        values = [*values, *(0.0,) * parameter.elements]
        picked = values[address.subindex : address.subindex + address.elements]
        return Values(parameter.format, tuple(_told(parameter.format, value) for value in picked))

    def _values_in(self, drive_object: int, parameter: DriveParameter) -> Sequence[float]:
        if parameter.code == "r0980":
            return self.numbers(drive_object)
        if parameter.group == MESSAGES and drive_object == CONTROL_UNIT and len(self._objects) > 1:
            return ()
        return self.values(parameter.code)

    def _write(self, drive_object: int, address: Address, block: Values) -> Result:
        parameter = self._found(drive_object, address)
        if isinstance(parameter, Failed):
            return parameter
        if address.attribute is not Attribute.VALUE:
            fixed = address.attribute is Attribute.DESCRIPTION
            return Failed(ErrorNumber.DESCRIPTION_FIXED if fixed else ErrorNumber.TEXT_FIXED)
        if not parameter.writable:
            return Failed(ErrorNumber.READ_ONLY, (address.subindex,))
        wrong = _wrong_index(parameter, address) or _wrong_values(parameter, address, block)
        if wrong is not None:
            return wrong
        if not all(names_known(parameter, value, self._by_number) for value in block.values):
            return Failed(ErrorNumber.NO_INTERCONNECTION)
        if parameter.when is not When.ALWAYS and self._pulses():
            return Failed(ErrorNumber.CONTROLLER_ENABLED)
        if parameter.when is When.COMMISSIONING and not self.values(COMMISSIONING)[0]:
            return Failed(ErrorNumber.ONLY_COMMISSIONING)
        return self._take(parameter, address, block)

    def _take(self, parameter: DriveParameter, address: Address, block: Values) -> Result:
        code = parameter.code
        if code == CLEARS and block.values[0]:
            return Failed(ErrorNumber.ONLY_RESET, (0,))
        if code in SAVES:
            self._saving = SAVE_TIME if block.values[0] else self._saving
        elif code == CLEARS or (code == ACKNOWLEDGES and block.values[0]):
            self._act(code)
        elif code in self._shared:
            self._shared[code] = block.values[0]
        elif not parameter.trigger:
            self._ram[code][address.subindex : address.subindex + address.elements] = block.values
        return Written()

    def _copy(self) -> tuple[dict[str, list[float]], dict[str, float]]:
        shared = {code: value for code, value in self._shared.items() if code in self._parameters}
        return {code: list(values) for code, values in self._ram.items()}, shared


def _whole(copy: tuple[Mapping[str, list[float]], Mapping[str, float]]) -> dict[str, list[float]]:
    ram, shared = copy
    return {**ram, **{code: [value] for code, value in shared.items()}}


def _wrong_index(parameter: DriveParameter, address: Address) -> Failed | None:
    if not parameter.count:
        return Failed(ErrorNumber.NO_ARRAY) if address.subindex or address.count > 1 else None
    if address.subindex + address.elements > parameter.count:
        return Failed(ErrorNumber.NO_SUBINDEX, (max(address.subindex, parameter.count),))
    return None


def _wrong_values(parameter: DriveParameter, address: Address, block: Values) -> Failed | None:
    layout = LAYOUTS[parameter.format]
    raw = RAW[layout.size] if layout.code in "BHI" else None
    if block.format not in (parameter.format, raw):
        return Failed(ErrorNumber.WRONG_TYPE)
    if len(block.values) != address.elements:
        return Failed(ErrorNumber.WRONG_COUNT)
    low, high = (rounded(parameter.format, limit) for limit in (parameter.low, parameter.high))
    for subindex, value in enumerate(block.values, address.subindex):
        if not low <= value <= high:
            return Failed(ErrorNumber.OUT_OF_LIMITS, (subindex,))
        if parameter.allowed and value not in parameter.allowed:
            return Failed(ErrorNumber.NOT_PERMITTED, (subindex,))
    return None


def _told(format: Format, value: float) -> float:
    return value if format is Format.FLOAT32 else round(value)
