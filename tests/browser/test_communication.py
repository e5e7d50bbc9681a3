"""The Communication page in a real browser: numbers move, words are fetched again, the forecast answers while one types."""

import pytest
from playwright.sync_api import expect

from tests.browser.station import AXE, LANGUAGES, SIZES, Operator, lay_out, speak


def test_numbers_move_words_come_again_and_the_forecast_answers(operator: Operator) -> None:
    page = operator.page
    operator.go("/communication?open=hall.1")
    expect(page.locator('[data-tag="sys.link.hall.polls"] b')).not_to_have_text("– –")
    expect(page.locator(".co-state[data-tag='sys.link.hall.state']")).to_have_text("Up")
    words = page.locator("#words tbody tr", has_text="0x1002").locator("td").nth(2)
    first = words.inner_text()
    operator.trip(1, 4)  # over-current: the drive lets its motor go
    assert first != "0000"
    expect(words).to_have_text("0000", timeout=30_000)
    cost = page.locator("#co-cost-hall")
    page.fill("#co-n-hall", "500")
    expect(cost).to_contain_text("500 more registers cost")
    page.fill("#co-n-hall", "-3")
    expect(page.locator("#co-n-hall:invalid")).to_be_visible()
    page.wait_for_timeout(500)
    expect(cost).to_contain_text("500 more registers cost")
    page.click("a[aria-expanded=true]")
    expect(page.locator("#words")).to_have_count(0)
    page.click(".foot a.f-comm")
    expect(page.locator("h1")).to_have_text("Communication")


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_it_fits_every_size_in_every_language_and_axe_finds_nothing(operator: Operator, theme: str) -> None:
    page, url = operator.page, operator.server.url
    page.context.add_cookies([{"name": "pogon_theme", "value": theme, "url": url}])
    for lang in LANGUAGES:
        speak(page, lang, url)
        operator.go("/communication?open=hall.2")
        for width, height in SIZES.values():
            lay_out(page, width, height)
            wide = page.evaluate(
                "[document.documentElement, document.getElementById('content')].map(e => e.scrollWidth - e.clientWidth)"
            )
            assert wide == [0, 0], (width, lang)
            if lang == "en":
                page.evaluate(AXE.read_text("utf-8"))
                found = page.evaluate("axe.run().then(r => r.violations.map(v => [v.id, v.nodes.map(n => n.html)]))")
                assert found == [], (width, found)
