"""A virtual SINAMICS asked for its parameters by telegrams."""

from collections.abc import Sequence

from app.plant import types
from app.plant.plant_files.languages import LANGUAGES
from app.profidrive.parameter_access.formats import Format
from app.profidrive.parameter_access.mailbox import LOOK, data_of, look, request_words
from app.profidrive.parameter_access.messages import (
    Address,
    Attribute,
    Failed,
    Request,
    Result,
    Values,
    decode_answer,
    encode_request,
    results_of,
)
from app.profidrive.parameter_access.parameter import DriveParameter
from app.sim.sinamics.drive import VirtualSinamics
from tests.sim.sinamics.stand import at, step

_TYPE, PROBLEMS = types.read_type("sinamics", LANGUAGES)
PARAMETERS = _TYPE.type.drive_parameters
WINDOW = at(40601)


def powered(**options: float) -> VirtualSinamics:
    given = {"positioning": True, **options}
    return VirtualSinamics(disturbance=0, behind_mailbox=PARAMETERS, **given)  # type: ignore[arg-type]


def home(parameter: DriveParameter) -> int:
    """A drive object that has it."""
    return parameter.objects[-1]


def send(drive: VirtualSinamics, words: Sequence[int]) -> list[int]:
    """Write into the window and wait until it is done; the window."""
    drive.write(16, WINDOW, words)
    for _ in range(400):
        step(drive, drive.dt)
        window = drive.read(3, WINDOW, 122)
        if look(window[:LOOK]).done:
            return window
    raise AssertionError("the mailbox never got ready")


def ask(drive: VirtualSinamics, request: Request) -> tuple[Result, ...]:
    window = send(drive, request_words(encode_request(request)))
    return results_of(request, decode_answer(data_of(window, look(window).length)))


def read(drive: VirtualSinamics, code: str, subindex: int = 0, count: int = 1, *, object: int | None = None) -> Result:
    parameter = PARAMETERS[code]
    return ask(drive, Request(1, object or home(parameter), (Address(parameter.number, subindex, count),)))[0]


def values(drive: VirtualSinamics, code: str, subindex: int = 0, count: int = 1) -> tuple[float, ...]:
    found = read(drive, code, subindex, count)
    assert isinstance(found, Values), found
    return found.values


def write(
    drive: VirtualSinamics,
    code: str,
    *given: float,
    subindex: int = 0,
    format: Format | None = None,
    count: int | None = None,
    attribute: Attribute = Attribute.VALUE,
) -> Result:
    parameter = PARAMETERS[code]
    address = Address(parameter.number, subindex, len(given) if count is None else count, attribute)
    block = Values(format or parameter.format, given)
    return ask(drive, Request(2, home(parameter), (address,), (block,)))[0]


def error(result: Result) -> int | None:
    assert isinstance(result, Failed), result
    return result.number
