"""docs/plc: the blocks that write the images and table rows of each type that is a Pogon PLC, from its data; and all blocks as SCL for S7.

`docs/plc/codesys/PogonMap.st` and `PogonBlocks.st` are written by hand. The same data give the same files, byte for byte; `--check`
writes nothing and fails when one is stale. The blocks of a type have one input for each value, named `p_<point>`: what is not given keeps
its value.
"""

import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from app.plant import types  # noqa: E402
from app.plant.definitions import EquipmentType, Image, Point, TableMap  # noqa: E402
from app.plant.type_files.data import TypeData  # noqa: E402
from app.registers import plc_map  # noqa: E402
from app.registers.register import Register, Type  # noqa: E402

FOLDER = ROOT / "docs" / "plc"
HAND = ("PogonMap", "PogonBlocks")
INPUTS = {Type.U16: "WORD", Type.I16: "INT", Type.U32: "UDINT", Type.I32: "DINT", Type.F32: "REAL"}
PUT = {
    Type.U16: "Regs.W[{at}] := p_{key};",
    Type.I16: "Regs.W[{at}] := INT_TO_WORD(p_{key});",
    Type.U32: "Done := PogonPutDword(Reg := {at}, Value := UDINT_TO_DWORD(p_{key}), Regs := Regs);",
    Type.I32: "Done := PogonPutDword(Reg := {at}, Value := DINT_TO_DWORD(p_{key}), Regs := Regs);",
    Type.F32: "Done := PogonPutReal(Reg := {at}, Value := p_{key}, Regs := Regs);",
}
BITS_IN_SCL = {
    "PogonRealToBits": "PogonRealToBits := REAL_TO_DWORD(Number);",
    "PogonBitsToReal": "PogonBitsToReal := DWORD_TO_REAL(Bits);",
}
"""On S7 these conversions carry the bits over; in CODESYS they convert the number, so there a union does it."""


def main(arguments: Sequence[str]) -> int:
    stale = {path: text for path, text in files().items() if not path.is_file() or path.read_text("utf-8") != text}
    for path, text in stale.items():
        if "--check" in arguments:
            print(f"{path.relative_to(ROOT)} is stale: make registers")
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, "utf-8")
            print(path.relative_to(ROOT))
    return bool(stale) and "--check" in arguments


def files() -> dict[Path, str]:
    """File → its text."""
    sources = {name: (FOLDER / "codesys" / f"{name}.st").read_text("utf-8") for name in HAND}
    found: dict[Path, str] = {}
    for name in types.names():
        data, problems = types.read_type(name, ["en"])
        if problems:
            raise SystemExit("\n".join(map(str, problems)))
        if data.type.device.plc:
            sources[name] = type_text(data)
            found[FOLDER / "codesys" / f"{name}.st"] = sources[name]
    return found | {FOLDER / "s7" / f"{name}.scl": scl(text) for name, text in sources.items()}


# ---- blocks of a type ------------------------------------------------------------------------------------------


def block_name(kind: EquipmentType, place: str) -> str:
    """`PogonConveyor0100`, `PogonConveyorProduct`."""
    return "Pogon" + "".join(part.capitalize() for part in (*kind.name.split("_"), place))


def type_text(data: TypeData) -> str:
    """All blocks of one type."""
    kind = data.type
    assert kind.device.plc
    parts = [
        f"// Made by `make registers` from app/equipment/{kind.name}/: do not edit. Meanings: docs/registers/{kind.name}.md."
    ]
    parts += ["\n".join(_image(kind, image)) for image in kind.device.plc.images]
    parts += ["\n".join(_row(data, table)) for table in kind.tables.values()]
    return "\n\n".join(parts) + "\n"


def _image(kind: EquipmentType, image: Image) -> Iterator[str]:
    points = written(kind.points.values(), image.address, image.words)
    yield f"// Image 0x{image.address:04X}, {image.words} words: call it once per scan, its inputs are the values."
    yield f"FUNCTION_BLOCK {block_name(kind, f'{image.address:04X}')}"
    yield from _inputs(points)
    yield from ("VAR_IN_OUT", "    Regs : PogonRegisters;", "END_VAR")
    yield from ("VAR", "    Swap : PogonImage;", "    Done : BOOL;", "END_VAR")
    swap = f"Swap(Address := 16#{image.address:04X}, Words := {image.words}, Open := {{}}, Regs := Regs);"
    yield swap.format("TRUE")
    for key, register in points:
        yield from _put(key, register, f"16#{register.address:04X}", f"16#{register.address + 2:04X}")
    yield swap.format("FALSE")
    yield "END_FUNCTION_BLOCK"


def _row(data: TypeData, table: TableMap) -> Iterator[str]:
    kind, first = data.type, table.address + plc_map.TABLE_HEAD
    points = written((cell.point for cell in data.columns[table.key].values()), first, table.row)
    yield f"// A row of the table `{table.key}` at 0x{table.address:04X}: slots from 1; an empty one has p_id = 0."
    yield f"FUNCTION_BLOCK {block_name(kind, table.key)}"
    yield from _inputs(points, "    Slot : DINT;")
    yield from ("VAR_IN_OUT", "    Regs : PogonRegisters;", "END_VAR")
    yield from ("VAR", "    Row : DINT;", "    Generation : UINT;", "    Done : BOOL;", "END_VAR")
    yield f"Row := 16#{first:04X} + (Slot - 1) * {table.row};"
    yield f"Generation := (WORD_TO_UINT(Regs.W[Row + {table.row - 1}]) / 2) * 2 + 2;"
    yield f"Regs.W[Row + {plc_map.ROW_GENERATION}] := UINT_TO_WORD(Generation - 1);"
    for key, register in points:
        at = register.address - first
        yield from _put(key, register, f"Row + {at}", f"Row + {at + 2}")
    yield f"Regs.W[Row + {table.row - 1}] := UINT_TO_WORD(Generation);"
    yield f"Regs.W[Row + {plc_map.ROW_GENERATION}] := UINT_TO_WORD(Generation);"
    yield "END_FUNCTION_BLOCK"


def written(points: Iterable[Point], address: int, words: int) -> list[tuple[str, Register]]:
    """The values of an area in the order of their places; of a word that is told whole and in bits only the bits."""
    found = [(point.key, point.register) for point in points if point.register]
    inside = [(key, register) for key, register in found if address <= register.address < address + words]
    inside.sort(key=lambda one: (one[1].address, one[1].shift))
    in_bits = {register.address for _, register in inside if register.mask is not None}
    return [(key, register) for key, register in inside if register.mask is not None or register.address not in in_bits]


def _inputs(points: Sequence[tuple[str, Register]], *more: str) -> Iterator[str]:
    yield "VAR_INPUT"
    yield from more
    for key, register in points:
        if register.mask is not None:
            yield f"    p_{key} : {'BOOL' if register.mask == 1 else 'WORD'};"
        elif register.type is Type.U64:
            yield from (f"    p_{key}_high : UDINT;", f"    p_{key}_low : UDINT;")
        else:
            yield f"    p_{key} : {INPUTS[register.type]};"
    yield "END_VAR"


def _put(key: str, register: Register, at: str, next_at: str) -> Iterator[str]:
    if register.mask is not None:
        for bit in range(register.mask.bit_length()):
            told = f"p_{key}" if register.mask == 1 else f"(SHR(WORD_TO_DWORD(p_{key}), {bit}) AND 1) = 1"
            yield f"Done := PogonPutBit(Reg := {at}, Bit := {register.shift + bit}, Value := {told}, Regs := Regs);"
    elif register.type is Type.U64:
        yield PUT[Type.U32].format(at=at, key=f"{key}_high")
        yield PUT[Type.U32].format(at=next_at, key=f"{key}_low")
    else:
        yield PUT[register.type].format(at=at, key=key)


# ---- SCL -------------------------------------------------------------------------------------------------------

_UNIT = re.compile(r"^(TYPE|FUNCTION_BLOCK|FUNCTION)\b(.*?)^END_\1\b", re.MULTILINE | re.DOTALL)


def scl(text: str) -> str:
    """Structured text of ours as SCL: block names in quotes, own names with #, `VERSION`, `BEGIN`; two conversions without a union."""
    found, end = [], 0
    for unit in _UNIT.finditer(text):
        found.append(
            _quoted(text[end : unit.start()]).replace(
                "for CODESYS; docs/plc/s7 has the same for S7-1200 and S7-1500", "as SCL"
            )
        )
        end = unit.end()
        found.append(_scl_type(unit[0]) if unit[1] == "TYPE" else _scl_block(unit[0], unit[1]))
    return "".join(found) + text[end:]


def _scl_type(text: str) -> str:
    if "UNION" in text:
        return "// (no union here: S7 carries the bits over by itself)"
    name = re.match(r"TYPE (\w+) :", text)[1]  # type: ignore[index]
    return f'TYPE "{name}"\nVERSION : 0.1\n' + _quoted(text.partition("\n")[2]).replace("END_STRUCT\n", "END_STRUCT;\n")


def _scl_block(text: str, word: str) -> str:
    head, _, rest = text.partition("\n")
    name = re.match(rf"{word} (\w+)", head)[1]  # type: ignore[index]
    result = head.partition(" : ")[2]
    declared, body = _parts(rest.removesuffix(f"END_{word}"))
    if name in BITS_IN_SCL:
        declared, body = (
            re.sub(r"^VAR\n.*?^END_VAR\n", "", declared, flags=re.DOTALL | re.MULTILINE),
            BITS_IN_SCL[name] + "\n",
        )
    own = {*re.findall(r"^\s+(\w+) :", declared, re.MULTILINE), *([name] if result else [])}
    opening = f'{word} "{name}"' + (f" : {result}" if result else "")
    optimised = "{ S7_Optimized_Access := 'TRUE' }"
    return f"{opening}\n{optimised}\nVERSION : 0.1\n{_quoted(declared)}BEGIN\n{_scl_body(body, own)}END_{word}"


def _parts(text: str) -> tuple[str, str]:
    """Declarations and body of a block."""
    at = text.rindex("END_VAR\n") + len("END_VAR\n")
    return text[:at], text[at:]


def _scl_body(body: str, own: set[str]) -> str:
    lines = []
    for line in body.splitlines():
        code, slashes, remark = line.partition("//")
        code = re.sub(r"(?<![\w.#])[A-Za-z]\w*", lambda one: _named(one, own), code)
        code = re.sub(r"\b(SHR|SHL)\(", r"\1(IN := ", code)
        lines.append(_shifts(_least(code)) + slashes + remark)
    return "\n".join(lines) + "\n"


def _named(word: re.Match[str], own: set[str]) -> str:
    """A word of a line of code; what stands before `:=` in brackets is a name of the block that is called."""
    before, after = word.string[: word.start()], word.string[word.end() :]
    if after.startswith(" :=") and before.count("(") > before.count(")"):
        return word[0]
    return f"#{word[0]}" if word[0] in own else f'"{word[0]}"' if word[0].startswith("Pogon") else word[0]


def _shifts(code: str) -> str:
    """`SHR(IN := a, n)` → `SHR(IN := a, N := n)`, with any brackets in a."""
    return _second_argument(code, ("SHR(IN := ", "SHL(IN := "), "N := ")


def _least(code: str) -> str:
    """`MIN(a, b)` → `MIN(IN1 := a, IN2 := b)`."""
    code = re.sub(r"\b(MIN|MAX)\(", r"\1(IN1 := ", code)
    return _second_argument(code, ("MIN(IN1 := ", "MAX(IN1 := "), "IN2 := ")


def _second_argument(code: str, calls: Sequence[str], name: str) -> str:
    for call in calls:
        at = code.find(call)
        while at >= 0:
            depth, place = 0, at + len(call)
            while code[place] != "," or depth:
                depth += {"(": 1, ")": -1}.get(code[place], 0)
                place += 1
            code = f"{code[: place + 2]}{name}{code[place + 2 :]}"
            at = code.find(call, at + 1)
    return code


def _quoted(text: str) -> str:
    """Types of ours in quotes; remarks stay as they are."""
    return re.sub(r"(: |OF )(Pogon\w+);", r'\1"\2";', text)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
