"""What is said of a file that cannot be read (app/files.py), as texts of ours."""

import re

from app.files import ORDINARY
from app.plant.said import said

WORDS = {
    "a folder": "a_folder",
    "a pipe": "a_pipe",
    "a socket": "a_socket",
    "a device": "a_device",
    "no file": "no_file",
    "no such file": "no_such_file",
    "a link that leads out of its folder": "link_outside",
    "Too many levels of symbolic links": "links_in_circle",
    "Permission denied": "no_right",
    "text in UTF-8": "utf8",
    ORDINARY: "toml_file",
    rf"{ORDINARY} in (?P<folder>.*)": "ordinary_in",
    r"(?P<number>\d+) bytes": "bytes",
    r"at most (?P<number>\d+) bytes": "most_bytes",
    r"byte (?P<byte>0x\w\w)": "byte",
}
"""What is said, a pattern → the text of ours with the values that it names."""


def file_words(text: str) -> str:
    """`text` as one of ours; what the system says otherwise stays as it is."""
    for pattern, key in WORDS.items():
        if match := re.fullmatch(pattern, text, re.S):
            return said(f"mistake.{key}", **match.groupdict())
    return text
