"""An operator at a running Pogon in this process: forms as the pages send them, answers as the scripts read them."""

import html
import re
from dataclasses import dataclass
from typing import Any

from fastapi.testclient import TestClient

from app import chance
from app.runtime import Runtime
from tests.virtual import until
from tests.web.people import Staff

__all__ = ["Answer", "Operator", "button", "line_of", "runtime_of", "until", "whole_line_of", "words"]
Answer = Any


def runtime_of(client: TestClient) -> Runtime:
    runtime: Runtime = client.app.state.runtime  # type: ignore[attr-defined]
    return runtime


@dataclass
class Operator:
    """A person in a browser: signs in anew with `sit`."""

    staff: Staff
    name: str
    roles: tuple[str, ...]
    language: str = "en"
    sid: str = ""

    def sit(self) -> "Operator":
        """This person's browser is the one that asks next."""
        if not self.sid:
            self.sid = self.staff.enter(self.name, *self.roles)
        self.staff.have(self.sid)
        self.staff.client.cookies.set("pogon_lang", self.language)
        return self

    def get(self, path: str, fragment: bool = True) -> Answer:
        self.sit()
        return self.staff.client.get(path, headers={"HX-Request": "true"} if fragment else {})

    def nonce(self) -> str:
        answer: str = self.get("/nonce").json()["nonce"]
        return answer

    def post(self, path: str, fragment: bool = True, **fields: str) -> Answer:
        self.sit()
        headers = {"HX-Request": "true"} if fragment else {}
        return self.staff.post(path, fields, **headers)

    def press(self, path: str, **fields: str) -> Answer:
        """One press of a button, with a fresh nonce and an identity of its own."""
        return self.post(path, **{"id": chance.token_hex(16), "nonce": self.nonce(), **fields})

    def take(self, equipment: str) -> None:
        answer = self.post(f"/equipment/{equipment}/token/take")
        assert answer.status_code == 200, answer.text


def line_of(answer: Answer) -> str:
    """The sentence for the operator, without the name of the command or the setpoint that it is about."""
    hint = re.search(r'<p[^>]*data-message[^>]*data-hint="([^"]*)"', answer.text, re.S)
    return words(hint[1]) if hint else whole_line_of(answer)


def whole_line_of(answer: Answer) -> str:
    """The line for the operator as the message line shows it."""
    found = re.search(r"<p[^>]*data-message[^>]*>(.*?)</p>", answer.text, re.S)
    return words(found[1]) if found else ""


def button(answer: Answer, part: str) -> str:
    """The source of the button `part` of a fragment or page."""
    found = re.search(rf'<button[^>]*data-part="{re.escape(part)}".*?</button>', answer.text, re.S)
    assert found, f"no button {part}"
    return found[0]


def words(source: str) -> str:
    """The text of a piece of HTML with ordinary spaces."""
    text = html.unescape(re.sub(r"<[^>]*>", " ", source))
    return re.sub(r"\s+", " ", text.replace("\u00a0", " ").replace("\u202f", " ")).strip()
