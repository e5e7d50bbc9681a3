"""The letters that come with the pages: what we write is among them, digits are of equal width, faces are fetched early."""

import re
import unicodedata
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from fontTools.ttLib import TTFont
from fontTools.varLib.instancer import instantiateVariableFont

from tests.conftest import ROOT

FACE = re.compile(
    r"@font-face \{\s*font-family: (?P<name>[^;]+);.*?url\(\"\.\./(?P<file>[^\"]+)\"\).*?unicode-range: (?P<range>[^;]+);",
    re.S,
)
WRITTEN = (
    "app/locale/**/*.toml",
    "app/equipment/**/*.toml",
    "app/web/*.py",
    "plants/**/*.toml",
    "templates/**/*.html",
    "static/js/*.js",
)
DRAWN = "šđčćžŠĐČĆŽáčďéěíňóřšťúůýžÁČĎÉĚÍŇÓŘŠŤÚŮÝŽäöüßÄÖÜ0123456789°µμ²³·–—×±→←↑↓▲▼✓…„“”‚‘’«»≤≥≠−ΔΩ∞\u00a0\u202f"


def faces(name: str) -> dict[str, set[int]]:
    """Files of a family that font.css names, each with the characters that it is fetched for."""
    found = FACE.finditer((ROOT / "static" / "css" / "font.css").read_text("utf-8"))
    return {face["file"]: set(characters(face["range"])) for face in found if face["name"].strip('"') == name}


def characters(ranges: str) -> list[int]:
    spans = [one.strip().removeprefix("U+").split("-") for one in ranges.split(",")]
    return [code for span in spans for code in range(int(span[0], 16), int(span[-1], 16) + 1)]


def font(file: str) -> TTFont:
    return TTFont(ROOT / "static" / file)


@pytest.mark.parametrize("name", ["Pogon", "Pogon Mono"])
def test_a_face_is_fetched_for_what_it_has(name: str) -> None:
    for file, wanted in faces(name).items():
        assert {hex(code) for code in wanted - set(font(file).getBestCmap())} <= {"0xad"}, (
            file
        )  # a soft hyphen is not drawn


@pytest.mark.sweep(8)
def test_every_character_that_we_write_is_in_the_face() -> None:
    ours = set().union(*faces("Pogon").values())
    written = "".join(path.read_text("utf-8") for pattern in WRITTEN for path in ROOT.glob(pattern))
    lacking = {one for one in written + DRAWN if ord(one) not in ours and unicodedata.category(one) not in ("Cc", "Cf")}
    assert lacking == set()


@pytest.mark.parametrize("weight", [400, 600])
def test_digits_are_of_equal_width(weight: int) -> None:
    face = instantiateVariableFont(font("vendor/arimo-latin.woff2"), {"wght": weight})
    names = face.getBestCmap()
    assert len({face["hmtx"][names[ord(digit)]][0] for digit in "0123456789"}) == 1


@pytest.mark.sweep(8)
def test_pages_fetch_the_letters_at_once_under_a_lasting_name(client: TestClient) -> None:
    page = client.get("/").text
    early = set(
        re.findall(r'<link rel="preload" href="(/static/[^"]+)" as="font" type="font/woff2" crossorigin>', page)
    )
    sheet = client.get(re.findall(r'href="(/static/css/pages\.[^"]+)"', page)[0]).text
    named = set(re.findall(r'url\("(/static/[^"]+)"\)', sheet))
    assert len(early) == 2 and early < named
    for url in named:
        answer = client.get(url)
        assert answer.headers["content-type"] == "font/woff2"
        assert answer.headers["cache-control"] == "public, max-age=31536000, immutable"
        assert Path(url).suffix == ".woff2" and answer.content[:4] == b"wOF2"


def test_pages_and_data_are_packed(client: TestClient) -> None:
    for url in ("/", "/equipment/m1", "/trends?tags=m1.speed"):
        answer = client.get(url)
        assert (answer.status_code, answer.headers["content-encoding"]) == (200, "gzip"), url
        assert "Accept-Encoding" in answer.headers["vary"]
        assert "content-encoding" not in client.get(url, headers={"Accept-Encoding": "identity"}).headers
    assert "content-encoding" not in client.get("/healthz").headers


def test_no_page_gives_the_same_token_twice(client: TestClient) -> None:
    tokens = [re.findall(r'name="csrf" value="([^"]+)"', client.get("/first").text)[0] for _ in range(3)]
    assert len(set(tokens)) == 3
