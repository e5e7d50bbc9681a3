"""Values of drive parameters in words: numbers in the language, options by their text, sources (BICO) and words of bits."""

import re

from app.errors import Refused
from app.plant.definitions import EquipmentType
from app.plant.register_parameters import unknown
from app.profidrive.parameter_access.formats import size_of
from app.profidrive.parameter_access.parameter import DriveParameter, Kind
from app.profidrive.parameter_access.source import is_source, source_text
from app.web import format as fmt
from app.web.operation import Operation

DECIMALS = 3
CONFIRMED = frozenset("MTCX")
"""Marks that stand for a source."""
ELEMENT = re.compile(r"(\d{1,3}):([pr]\d{4,5}|F[1-9A]\d\d)(?:\[(\d{1,5})\])?", re.ASCII)


def element_of(operation: Operation, key: str) -> tuple[int, DriveParameter, int]:
    """Drive object, parameter and index of `2:p1120` or `1:p0757[3]`.

    Raises:
        Refused: 422, the type of the machine has no such element that could be written.
    """
    return element_in(operation.equipment.equipment.type, key)


def element_in(kind: EquipmentType, key: str) -> tuple[int, DriveParameter, int]:
    """As `element_of`.

    Raises:
        Refused: 422.
    """
    found = ELEMENT.fullmatch(key)
    parameter = parameter_of(kind, found[2]) if found else None
    index = int(found[3] or 0) if found else 0
    if found is None or parameter is None or bool(found[3]) != bool(parameter.count) or index >= parameter.elements:
        raise Refused("dpar.no_element", 422, text=key[:40])
    if int(found[1]) > 255 or not parameter.writable:
        raise Refused("dpar.no_element", 422, text=key[:40])
    return int(found[1]), parameter, index


def parameter_of(kind: EquipmentType, code: str) -> DriveParameter | None:
    """The parameter `code` as it is known, where parameters are registers also one of which nothing is; None = there is none."""
    found = kind.drive_parameters.get(code)
    return unknown(code) if found is None and kind.device.parameters is not None else found


def confirmed(parameter: DriveParameter) -> bool:
    """Whether a source stands for its number and meaning; of one of which nothing is known nothing is to be doubted."""
    return not parameter.known or (bool(CONFIRMED & set(parameter.certainty)) and "?" not in parameter.certainty)


def value_text(operation: Operation, parameter: DriveParameter, value: float) -> str:
    """A value without its unit; an option with its text."""
    drawn = operation.equipment
    if is_source(parameter.kind):
        codes = {one.number: one.code for one in drawn.equipment.type.drive_parameters.values()}
        return source_text(parameter.kind, value, codes)
    if parameter.kind is Kind.BITS:
        return fmt.hexadecimal(int(value), 2 * size_of(parameter.format))
    text = number_text(value, drawn.lang)
    label = parameter.options.get(int(value)) if float(value).is_integer() else None
    return f"{text} – {drawn.t(label)}" if label else text


def number_text(value: float, lang: str) -> str:
    """A number as short as it can be."""
    return fmt.number(value, fmt.shortest(value, DECIMALS), lang)


def permitted_text(parameter: DriveParameter, lang: str) -> str:
    """The permitted range; of a source how it is written."""
    if not parameter.writable or not parameter.known:
        return ""
    if is_source(parameter.kind):
        return "r0722.0 · 0 · 1" if parameter.kind is Kind.BINECTOR else "r2050[1] · 0 · 1"
    if parameter.allowed:
        return ", ".join(number_text(one, lang) for one in parameter.allowed)
    low, high = (
        bound or number_text(value, lang)
        for bound, value in zip(parameter.bounds, (parameter.low, parameter.high), strict=True)
    )
    return f"{low} … {high}"
