"""Parameter sets as files: what is written is read again, and every mistake has its line."""

import json
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.commands.parameter_file import (
    COLUMNS,
    LARGEST,
    MOST_ELEMENTS,
    Element,
    Told,
    compared,
    csv_text,
    json_text,
    read_file,
    value_word,
)
from app.plant import types
from app.profidrive.parameter_access.formats import INTEGERS, LAYOUTS, Format
from app.profidrive.parameter_access.parameter import Kind

PARAMETERS = types.read_type("sinamics", ["en"])[0].type.drive_parameters
CODES = {one.number: one.code for one in PARAMETERS.values()}
KNOWN = PARAMETERS.get
HEAD = ";".join(COLUMNS)


def told(code: str, value: float, index: int = 0, object: int = 2) -> Told:
    return Told(Element(object, PARAMETERS[code], index, value), 'a name; "quoted"', "2026-03-01T12:00:00+01:00")


def some() -> list[Told]:
    """An element of every parameter that can be written, at its default."""
    return [
        told(one.code, one.default, index, object)
        for one in PARAMETERS.values()
        if one.writable
        for object in one.objects
        for index in range(min(one.elements, 2))
    ]


@pytest.mark.parametrize("form", ["csv", "json"])
def test_what_is_written_is_read_again_to_the_last_bit(form: str) -> None:
    rows = some()
    text = csv_text(rows, CODES, str) if form == "csv" else json_text(rows, CODES, "sinamics", "d1")
    read = read_file(text.encode("utf-8-sig"), KNOWN, "sinamics")
    assert read.wrong == [] and len(read.elements) > 200
    assert [(one.key, one.value) for one in read.elements] == [(row.element.key, row.element.value) for row in rows]
    assert read.kind == ("sinamics" if form == "json" else "")


@pytest.mark.sweep(8)
@given(st.sampled_from(sorted(PARAMETERS)), st.floats(allow_nan=False, allow_infinity=False, width=32))
def test_any_value_that_a_drive_can_hold_survives(code: str, value: float) -> None:
    parameter = PARAMETERS[code]
    layout = LAYOUTS[parameter.format].code
    if layout != "f":
        low, high = INTEGERS[layout]
        value = float(min(max(int(value), low), high))
    word = value_word(parameter, value, CODES)
    if parameter.kind in (Kind.BINECTOR, Kind.CONNECTOR):
        return
    assert float(word) == value or struct.pack("<f", float(word)) == struct.pack("<f", value)
    if parameter.format is Format.FLOAT32 and not float(value).is_integer():
        assert len(repr(word)) <= 16


@pytest.mark.parametrize(
    "text",
    [
        "object;parameter;index;value\r\n2;p1120;;12,5\r\n",
        "object,parameter,value\n2,p1120,12.5\n",
        "VALUE\tobject\tparameter\n12.5\t2\tp1120\n\n",
        'parameter;value;object;extra\np1120;"12,5";2;whatever\n',
        json.dumps({"format": "pogon-drive-parameters", "version": 1, "parameters": [{"object": 2, "parameter": "p1120", "value": 12.5}]}),
    ],
)  # fmt: skip
def test_what_a_spreadsheet_makes_of_a_file_is_understood(text: str) -> None:
    read = read_file(text.encode(), KNOWN, "sinamics")
    assert not read.wrong and [(one.key, one.value) for one in read.elements] == [("2:p1120", 12.5)]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("2;p9999;;1;;;", "dcmp.no_parameter"),
        ("2;;;1;;;", "dcmp.no_parameter"),
        ("x;p1120;;1;;;", "dcmp.no_object"),
        ("256;p1120;;1;;;", "dcmp.no_object"),
        ("-1;p1120;;1;;;", "dcmp.no_object"),
        ("2;p1120;1;1;;;", "dcmp.no_index"),
        ("1;p0101;24;1;;;", "dcmp.no_index"),
        ("1;p0101;x;1;;;", "dcmp.no_index"),
        ("2;p1120;;;;;", "dcmp.no_value"),
        ("2;p1120;;ten;;;", "dcmp.no_value"),
        ("2;p1120;;nan;;;", "dcmp.no_value"),
        ("2;p1120;;1e999;;;", "dcmp.no_value"),
        ("2;p1120;;1_0;;;", "dcmp.no_value"),
        ("2;p1120;;1,2,3;;;", "dcmp.no_value"),
        ("2;p0840;;4711;;;", "dcmp.no_value"),
        ("2;p1120;;1000001;;;", "dcmp.wrong"),
        ("2;p0010;;1.5;;;", "dcmp.wrong"),
        ("2;p1120;;1;", "dcmp.cells"),
        ("2;p1120;;5;;;\r\n2;p1120;;6;;;", "dcmp.twice"),
    ],
)
def test_a_wrong_line_is_named_and_the_others_stand(line: str, reason: str) -> None:
    text = f"{HEAD}\r\n2;p1121;;7;;;\r\n{line}\r\n"
    read = read_file(text.encode(), KNOWN, "sinamics")
    assert [one.reason for one in read.wrong] == [reason]
    assert read.wrong[0].line == 2 + line.count("\n") + 1
    assert "2:p1121" in {one.key for one in read.elements}


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "dcmp.no_file"),
        (b"\xef\xbb\xbf  \n", "dcmp.no_file"),
        (b"\x00\x01", "dcmp.no_file"),
        ("Ž".encode("cp1250"), "dcmp.encoding"),
        (b"%PDF-1.7\n1 0 obj", "dcmp.columns"),
        (b"object;value\n1;2\n", "dcmp.columns"),
        (b"object;parameter;value;value\n1;p1120;2;2\n", "dcmp.columns"),
        (HEAD.encode(), "dcmp.no_file"),
        (b'object;parameter;value\n2;p1120;"1\n', "dcmp.no_csv"),
        (b"{", "dcmp.no_json"),
        (b'{"a": ' + b"[" * 100_000, "dcmp.no_json"),
        (b"{}", "dcmp.no_format"),
        (b'{"format": "pogon-drive-parameters", "version": 2, "parameters": []}', "dcmp.version"),
        (b'{"format": "pogon-drive-parameters", "version": 1, "type": "epos", "parameters": []}', "dcmp.other_type"),
        (b'{"format": "pogon-drive-parameters", "version": 1, "parameters": [3]}', "dcmp.cells"),
        (b"x" * (LARGEST + 1), "dcmp.too_large"),
        (b"object;parameter;value\n" + b"2;p1120;1\n" * (MOST_ELEMENTS + 1), "dcmp.too_many"),
    ],
)
def test_what_is_no_parameter_set_is_told_and_nothing_of_it_used(data: bytes, reason: str) -> None:
    read = read_file(data, KNOWN, "sinamics")
    assert read.wrong[0].reason == reason and not read.elements


@given(st.binary(max_size=300))
def test_no_input_raises_anything(data: bytes) -> None:
    read_file(data, KNOWN, "sinamics")
    read_file(HEAD.encode() + b"\n" + data, KNOWN, "sinamics")
    read_file(b'{"format": "pogon-drive-parameters", "version": 1, "parameters": [' + data + b"]}", KNOWN, "sinamics")


def test_two_sets_are_compared_element_by_element() -> None:
    here = {one.element.key: one.element for one in (told("p1120", 5), told("p1121", 6), told("p0757", 1, 1, 1))}
    there = {one.element.key: one.element for one in (told("p1121", 6), told("p1120", 7), told("p1082", 1500))}
    found = {one.key: (one.here, one.there, one.same) for one in compared(here, there)}
    assert list(found) == ["1:p0757[1]", "2:p1082", "2:p1120", "2:p1121"]
    assert found["2:p1120"] == (5, 7, False) and found["2:p1121"] == (6, 6, True)
    assert found["2:p1082"] == (None, 1500, False) and found["1:p0757[1]"] == (1, None, False)
