"""A page that is left open while its machine is taken out of the plant, and put in again."""

import re
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import Page, expect

from tests.browser.station import serving, small
from tests.conftest import ROOT, PogonServer


def live(page: Page, seconds: float = 10) -> None:
    expect(page.locator("body[data-live=live]")).to_be_attached(timeout=seconds * 1000)


def test_a_machine_taken_out_of_the_plant_is_said_and_found_again(page: Page, tmp_path: Path) -> None:
    file = small(tmp_path, "m1", "c1") / "plant" / "plant.toml"
    whole = file.read_text("utf-8")
    without = re.sub(r"\[equipment\.c1\]\n(?:.+\n)*", "", whole)
    with serving(tmp_path, {}) as server:
        other = page.context.new_page()
        other.goto(f"{server.url}/equipment/m1")
        page.goto(f"{server.url}/equipment/c1")
        live(page)
        live(other)
        expect(page.locator(".off-gone").first).to_be_hidden()
        reload(server, file, without)
        gone = page.locator(".offline")
        expect(gone).to_contain_text("This machine is no longer in the plant", timeout=30_000)
        expect(gone.locator(".off-gone").first).to_be_visible()
        expect(gone.get_by_text("Connection to the server lost")).to_be_hidden()
        expect(gone.get_by_text("Reconnecting")).to_be_hidden()
        page.wait_for_timeout(4000)
        expect(gone.locator(".off-gone").first).to_be_visible()
        live(other)
        expect(other.locator(".off-gone").first).to_be_hidden()
        reload(server, file, whole)
        live(page, seconds=20)
        expect(gone).to_be_hidden()
        reload(server, file, without)
        expect(gone.locator("a.off-gone")).to_be_visible(timeout=30_000)
        gone.locator("a.off-gone").click()
        page.wait_for_url(f"{server.url}/")
        live(page)


def test_a_screen_taken_out_of_the_plant_is_said_and_found_again(page: Page, tmp_path: Path) -> None:
    """It said that the connection was lost and tried to reconnect for ever, beside a server that answered."""
    file = small(tmp_path, "m1", "c1") / "plant" / "plant.toml"
    drawing = file.parent / "screens" / "one.svg"
    drawing.parent.mkdir()
    drawing.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 400 100"><text x="9" y="50" data-tag="m1.speed"/></svg>', "utf-8"
    )  # fmt: skip
    with serving(tmp_path, {}) as server:
        page.goto(f"{server.url}/screens/one")
        live(page)
        text = drawing.read_text("utf-8")
        drawing.unlink()
        reload(server, file, file.read_text("utf-8"))
        gone = page.locator(".offline")
        expect(gone).to_contain_text("This screen is no longer in the plant", timeout=30_000)
        expect(gone.get_by_text("Connection to the server lost")).to_be_hidden()
        expect(gone.get_by_text("Reconnecting")).to_be_hidden()
        drawing.write_text(text, "utf-8")
        reload(server, file, file.read_text("utf-8"))
        live(page, seconds=20)
        expect(gone).to_be_hidden()


def reload(server: PogonServer, file: Path, text: str) -> None:
    """Let a running server take its plant anew."""
    file.write_text(text, "utf-8")
    command = [sys.executable, "-m", "app.cli", "reload", "--yes", "--data", str(server.data)]
    answer = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert answer.returncode == 0, answer.stderr
