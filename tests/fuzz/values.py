"""Values that no page of ours sends, by the kind of field that they are put into.

Each may hold `MARK`: where it comes back as a tag, an attribute or a script, somebody's text became a part of a page.
"""

from dataclasses import dataclass
from random import Random
from typing import Any

MARK = "fuzz"
"""Begins the name of every tag and attribute that a value tries to smuggle into a page."""
CSRF, NONCE, FRESH = "[token of the form]", "[nonce]", "[id]"
"""Stand for what is made when a request is sent: whoever has none of them gets no further than the door."""

NUMBERS = (
    *("", "NaN", "nan", "inf", "-inf", "Infinity", "-Infinity", "1e400", "-1e400", "1e-400", "5e-324", "1e308", "1e5"),
    *("-0", "-0.0", "+5", "00012", "0x10", "0b1", "1_000", "1,5", "1.5", "1.5.5", "1.000,5", "1 000", "1\u00a0000"),
    *("٣", "１２", "²", "Ⅷ", "−5", "–5", " 5 ", "5\n", "5\x00", "9" * 400, "a" * 400, "-1", "0", "1", "65535", "65536"),
    *("2147483648", "-2147483649", "4294967296", "9007199254740993", "9223372036854775808", "-9223372036854775809"),
    *("18446744073709551616", "0.1", "1e-7", "1/0", "5%", "true", "None", "null", "[]", "{}", "5;6", "5,6"),
)
TEXTS = (
    *(
        "",
        " ",
        "\x00",
        "a\x00b",
        "\ud800",
        "\udfff",
        "a\ud83d",
        "\u202eabc",
        "\u2066abc",
        "\u200f",
        "\ufeff",
        "\u2028x\u2029",
    ),
    *(
        "one\ntwo",
        "one\r\ntwo",
        "one\rtwo",
        "\t",
        "\x1b[31m",
        "\x7f",
        "\x85",
        "'",
        '"',
        "`",
        "\\",
        "a'b\"c`d",
        "''",
        '""',
    ),
    *(
        "=cmd()",
        "=1+1",
        "+1+1",
        "-1-1",
        "@SUM(A1)",
        "\t=1",
        "\r=1",
        "|x",
        "%x",
        '=HYPERLINK("x")',
        ";=1+1",
        ",=1+1",
        '";=1',
    ),
    *(f"<script>{MARK}()</script>", f"<{MARK}>", f'"><{MARK}>', f"'><{MARK}>", f'" {MARK}="1', f"' {MARK}='1"),
    *(f"</script><{MARK}>", f"</title><{MARK}>", f"</textarea><{MARK}>", f"--><{MARK}>", f"]]><{MARK}>", f"x {MARK}=1"),
    *(
        f"&lt;{MARK}&gt;",
        "&amp;#60;",
        "&#x3c;",
        "{{7*7}}",
        "{%x%}",
        "{0}",
        "{name}",
        "{",
        "}",
        "%s",
        "%(name)s",
        "%",
        "%00",
    ),
    *(
        f"javascript:{MARK}",
        f"data:text/html,<{MARK}>",
        "//evil.test",
        "/\\evil.test",
        "https://evil.test/",
        "../../etc/passwd",
    ),
    *(
        "a" * 400,
        "é" * 300,
        "x" * 15_000,
        "x" * 100_000,
        "💥",
        "e\u0301" * 100,
        "ﷺ" * 50,
        "ß",
        "İ",
        "ǅ",
        "a b",
        "*",
        "?",
        "#",
        "&a=b",
    ),
    *("null", "None", "true", "[]", "{}", "' OR 1=1 --", "%' --", "_", "a;b", "a,b", "a|b", "a:b", "a/b", "."),
)
TIMES = (
    *("", "now", "2026-13-45", "2026-02-30", "2026-03-29T02:30", "2026-10-25T02:30", "9999-12-31T23:59", "0001-01-01"),
    *(
        "0001-01-01T00:00",
        "24:00",
        "99:99",
        "12:60",
        "-1:00",
        "2026-03-09T06:05+14:00",
        "2026-03-09T06:05Z",
        "2026-03-09",
    ),
    *(
        "9999-12-31T23:59:59-14:00",
        "0001-01-01T00:00+14:00",
        "1e9",
        "-1",
        "20260309",
        "٢٠٢٦-٠٣-٠٩",
        "2026-3-9",
        "10000-01-01",
    ),
    *("2026-W10", "2026-068", "06:05:00.123456789", "1970-01-01", "-0001-01-01", "2026-03-09T06:05:00.000000Z"),
)
WORDS = ("1", "5", "0", "on", "Marko", "m1", "2026-03-09T06:05", "speed")
"""Put where a field is empty, and something is wanted there."""
KINDS = {"number": NUMBERS, "text": TEXTS, "time": TIMES, "choice": (*TEXTS, *NUMBERS[:12])}
TREES: tuple[Any, ...] = (
    *(
        None,
        True,
        False,
        0,
        -1,
        1.5,
        -0.0,
        float("nan"),
        float("inf"),
        float("-inf"),
        10**400,
        2**63,
        2**53 + 1,
        "",
        "5",
        "NaN",
    ),
    *([], [None], [1, "a", {}], [[]], {}, {"a": 1}, {"": None}, "\ud800", "\x00", [5] * 3000, {"x": {"y": {"z": []}}}),
)
"""Of other kinds than a field of JSON is, too; `nan` and `inf` are written as Python writes them, which is no JSON."""
BODIES = (
    *(
        b"",
        b"null",
        b"[]",
        b"{}",
        b"1",
        b'"a"',
        b"{",
        b'{"a":',
        b"[" * 5000,
        b'{"a":' * 3000,
        b"\xff\xfe\x00",
        b"\xef\xbb\xbf{}",
    ),
    *(
        b'{"id":NaN}',
        b'{"id":1e999}',
        b'{"a":1,"a":2}',
        b"%" * 9000,
        b"&" * 900,
        b"=" * 900,
        b"+%00=%ff%fe&" * 300,
        b"x" * 20_000,
    ),
    b'{"id":"\\ud800"}',
)
FILES = (
    b"--B\r\nContent-Disposition: form-data; name=\"csrf\"\r\n\r\nx\r\n--B\r\nContent-Disposition: form-data; "
    b'name="file"; filename="a.csv"\r\nContent-Type: text/csv\r\n\r\n\xff\x00=1+1\r\n--B--\r\n',
    b'--B\r\nContent-Disposition: form-data; name="file"; filename="../../x"\r\n\r\n' + b"\x00" * 9000 + b"\r\n--B--\r\n",
)  # fmt: skip


@dataclass(frozen=True)
class Field:
    """What a page says of one field of a form."""

    name: str
    kind: str
    """One of `KINDS`, or `secret`, `hidden`, `ticked` (a box)."""
    value: str = ""
    """What it holds before anybody types."""
    choices: tuple[str, ...] = ()
    on: bool = True
    """Whether a browser would send it as the page stands: a box that is ticked, a field that is not switched off."""
    one_of: str = ""
    """`radio` or `button`: of all with this name one is sent, or of all of the form one."""
    least: str = ""
    most: str = ""
    """Of a number or a time, as the page says."""
    needed: bool = False
    """The browser sends no form without it."""


def hostile(random: Random, kind: str) -> str:
    """A value for a field of `kind`; one in five is of another kind."""
    values = KINDS.get(kind) if random.random() < 0.8 else None
    return random.choice(values or random.choice((NUMBERS, TEXTS, TIMES)))


def fitting(random: Random, field: Field, password: str) -> str:
    """What a person might type there so that it is taken: what stands there, or something between the limits that the page names."""
    if field.kind == "secret":
        return password
    if field.choices:
        return field.value if random.random() < 0.5 else random.choice(field.choices)
    if field.kind != "number" or (field.value and random.random() < 0.5):
        return field.value or ("fuzz reason" if field.kind == "text" and field.needed else "")
    ends = [one for one in (field.least, field.most, field.value) if one]
    return random.choice(ends) if ends else "1"


def tame(random: Random, field: Field, password: str) -> str:
    """What a person might put there, or what the page has put there."""
    if field.kind == "secret":
        return password
    if field.choices:
        return random.choice(field.choices)
    return field.value or random.choice(WORDS)
