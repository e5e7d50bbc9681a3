"""The parameters of a drive for the pages that read and write them, through its mailbox or as registers, and what they keep of a drive.

What was read is kept by what the drive is (type, link, unit), not by what it is called: after the plant was read anew the same name may
be another drive, of which nothing is known yet.
"""

from collections.abc import Callable, Sequence
from typing import TypeVar

from fastapi import FastAPI

from app.errors import LinkError, MailboxRefused, Refused
from app.links.mailbox import Missed, ParameterAccess
from app.plant.register_parameters import OBJECT
from app.profidrive.parameter_access.error_numbers import mailbox_key_of
from app.profidrive.parameter_access.formats import Format
from app.profidrive.parameter_access.messages import Address, Values
from app.web import format as fmt
from app.web.operation import Operation

CONTROL_UNIT = 1
"""The drive object that every drive has."""
OBJECT_COUNT, OBJECT_NUMBERS = 102, 101
MOST_OBJECTS = 24

Kept = TypeVar("Kept")


def mailbox_of(operation: Operation) -> ParameterAccess:
    """The one queue to the parameters of the machine.

    Raises:
        Refused: 503, the plant has no such link now.
        LinkError: the machine has no parameters.
    """
    link = operation.runtime.links.get(operation.equipment.link)
    if link is None:
        raise Refused("why.no_link", 503, link=operation.equipment.link)
    return link.parameters(operation.id)


def kept_of(app: FastAPI, operation: Operation, kind: str, make: Callable[[], Kept]) -> Kept:
    """What is kept of the drive under `kind` until the server ends; `make` makes what nothing is known in."""
    item = operation.equipment.equipment
    found: dict[tuple[str, str, int], Kept] = app.state.__dict__.setdefault(kind, {})
    key = item.type.name, item.link, item.unit
    if key not in found:
        found[key] = make()
    return found[key]


def has_objects(operation: Operation) -> bool:
    """Whether the parameters of the machine stand in drive objects."""
    return operation.equipment.equipment.type.device.parameters is None


async def objects_of(operation: Operation, mailbox: ParameterAccess) -> tuple[int, ...]:
    """The drive objects; only the first one, which every drive has, where it does not tell. A drive whose parameters are registers has
    none: it is asked nothing.

    Raises:
        LinkError: it could not be asked.
    """
    if not has_objects(operation):
        return (OBJECT,)
    wanted = [Address(OBJECT_COUNT), Address(OBJECT_NUMBERS, 0, MOST_OBJECTS)]
    count, numbers = await mailbox.read(CONTROL_UNIT, wanted, [Format.UNSIGNED16] * 2)
    for told in (count, numbers):
        if isinstance(told, Missed):
            raise told.error
    if not isinstance(count, Values) or not isinstance(numbers, Values):
        return (CONTROL_UNIT,)
    known = (int(number) for number in numbers.values[: int(count.values[0])])
    return tuple(number for number in known if number) or (CONTROL_UNIT,)


def drive_among(objects: Sequence[int]) -> int:
    """The drive object of the drive itself: the first one beside the Control Unit, which is it where there is no other."""
    return next((one for one in objects if one != CONTROL_UNIT), CONTROL_UNIT)


def told_of(error: LinkError | Refused) -> tuple[str, dict[str, object]]:
    """Text key and parameters of why the drive told nothing: its mailbox's own reason, if it gave one."""
    if isinstance(error, Refused):
        return error.reason, dict(error.params)
    if isinstance(error, MailboxRefused):
        return mailbox_key_of(error.number), {"number": fmt.hexadecimal(error.number)}
    return f"link.error.{error.kind}", {}


def problem_of(error: LinkError | Refused) -> tuple[str, dict[str, object]]:
    """As `told_of`, as a sentence about the drive."""
    key, params = told_of(error)
    return ("why.no_answer", {"cause": key}) if key.startswith("link.error.") else (key, params)
