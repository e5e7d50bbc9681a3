"""Every kind of line that the audit takes, and every end of one, has words in every language: the page prints no key."""

import re
from html import unescape

import pytest
from fastapi.testclient import TestClient

from app.access.audit.kinds import KINDS
from app.commands.lifecycle import ProgressState
from tests.web.people import Staff
from tests.web.test_alarms import LANGUAGES

CONTROL = ("taken", "released", "handed_over", "taken_over", "moved_up", "refused", "withdrawn", "lost", "revoked")
RESULTS = (
    *(("signin.ok", result) for result in ("ok", "refused", "failed", "sent")),
    *(("command", str(state)) for state in ProgressState),
    *(("control", what) for what in CONTROL),
)


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Staff:
    staff = Staff(demo)
    staff.enter("ana", "engineer", "admin")
    for kind in KINDS:
        staff.wait(staff.access.audit.record, kind, None, "m1")
    for kind, result in RESULTS:
        staff.wait(staff.access.audit.record, kind, None, "m1", result=result)
    return staff


@pytest.mark.sweep(8)
@pytest.mark.parametrize("lang", LANGUAGES)
def test_no_kind_and_no_result_is_printed_as_its_key(staff: Staff, lang: str) -> None:
    staff.client.cookies.set("pogon_lang", lang)
    pages, path = "", "/audit"
    while path:
        page = unescape(staff.client.get(path).text)
        pages += page
        older = re.search(r'href="(/audit\?[^"]*before=[^"]*)" rel="next"', page)
        path = older[1] if older else ""
    whats = set(re.findall(r'<th scope="row">([^<]*)</th>', pages))
    assert len(whats) > len(KINDS) * 0.8, "each kind has a line of its own"
    assert not [what for what in whats if what in KINDS or re.fullmatch(r"[a-z_.]*\.[a-z_.]*", what)]
    texts = staff.client.app.state.runtime.texts  # type: ignore[attr-defined]
    assert not [kind for kind in KINDS if not texts.has(lang, f"audit.kind.{kind}")]
    assert not [kind for kind in KINDS if not texts.has(lang, f"audit.group.{kind.partition('.')[0]}")]
    ends = set(re.findall(r"<td>([^<]*)(?:<small>[^<]*</small>)?\s*</td><td class=\"num dim\">", pages))
    words = {"failed", "sent"} if lang == "en" else set()
    told = {result for _, result in RESULTS} - words
    assert ends, "the ends of the lines are read"
    assert not ends & told, "an end is told in words"
