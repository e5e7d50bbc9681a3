"""A draft of a sequence becomes the plant's next revision: read in words, with a reason, whole or not at all; a former one comes back."""

import asyncio
import errno
import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from app import bundled, files
from app.blocks.sequence import SequenceState
from app.registers import plc_map
from app.registers.plc_map import Request
from tests.web.conftest import Start
from tests.web.people import Staff
from tests.web.test_sequence_editor import URL, Window

FILE = (bundled("plants/feeding") / "sequences" / "feed.toml").read_text("utf-8")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    found = tmp_path / "plant"
    shutil.copytree(bundled("plants/feeding"), found)
    return found


@pytest.fixture
def staff(start: Start, folder: Path) -> Iterator[Staff]:
    people = Staff(start(plant=folder))
    english(people, "ivana")
    yield people


def english(staff: Staff, name: str) -> None:
    staff.enter(name, "engineer", "operator")
    staff.client.cookies.set("pogon_lang", "en")


def take(staff: Staff, reason: str = "the fan needs longer", **other: str) -> Any:
    page = staff.client.get(f"{URL}/review").text
    found = {name: re.search(rf'name="{name}"\s+value="(\w*)"', page) for name in ("digest", "version")}
    given = {name: one[1] if one else "" for name, one in found.items()}
    return staff.post(f"{URL}/take", {**given, "reason": reason, "read": "1", **other})


def written(folder: Path) -> str:
    return (folder / "sequences" / "feed.toml").read_text("utf-8")


@pytest.mark.sweep(8)
def test_the_review_says_in_words_what_changes_and_what_follows(staff: Staff) -> None:
    Window(staff, "2").send("fields", minimum="25", label__en="Feed in", permissives__0__when="m1.frequency > 28")
    Window(staff, "2").send("do", do="add_step")
    page = staff.client.get(f"{URL}/review").text
    assert "Step “Feed in”: Minimum time: 20 → 25" in page
    assert "Step “Feed in”: Name (en): Feed → Feed in" in page
    assert "permissive 0: Condition: m1.frequency &gt; 29 → m1.frequency &gt; 28" in page
    assert "Step “New step”: new" in page
    assert "A simulated sequence seq1 begins in its initial state" in page


@pytest.mark.sweep(8)
def test_it_is_taken_with_a_reason_as_the_same_text_that_an_integrator_writes(staff: Staff, folder: Path) -> None:
    Window(staff, "2").send("fields", minimum="25")
    assert take(staff, reason=" ").status_code == 422
    assert take(staff, read="").status_code == 422 and written(folder) == FILE
    taken = take(staff)
    assert (taken.status_code, taken.headers["location"]) == (303, f"{URL}/history?done=2")
    assert written(folder) == FILE.replace("minimum = 20\n", "minimum = 25\n")
    runtime = staff.client.app.state.runtime  # type: ignore[attr-defined]
    assert runtime.plant.equipment["seq1"].sequence.steps[1].minimum == 25
    assert "As in the file" in Window(staff, "2").page
    assert (
        "Sequence edited" in staff.client.get("/audit").text
        and "the fan needs longer" in staff.client.get("/audit").text
    )
    page = staff.client.get(taken.headers["location"]).text
    assert "Revision 2 was taken." in page and "the fan needs longer" in page and "as it was written by hand" in page
    assert "Step “Feed”: Minimum time: 20 → 25" in page


@pytest.mark.sweep(8)
def test_a_draft_is_tried_out_before_it_is_taken_and_the_outcome_is_told_in_words(staff: Staff) -> None:
    Window(staff, "2").send("fields", minimum="2")
    assert "Try it out" in staff.client.get(f"{URL}/review").text
    assert staff.post(f"{URL}/try").status_code == 303
    page = staff.client.get(f"{URL}/review").text
    assert "It runs through in" in page and "Stop the conveyor, reverse the fan" in page and "older draft" not in page
    Window(staff, "2").send("fields", permissives__0__when="m1.frequency > 45", maximum="90")
    Window(staff, "1").send("fields", maximum="4")
    assert "older draft" in staff.client.get(f"{URL}/try").text
    staff.post(f"{URL}/try")
    told = staff.client.get(f"{URL}/try").text
    assert "Step 1 “Start the fan” exceeds its maximum time. Missing: Fan at speed (m1.frequency &gt; 45)" in told
    Window(staff, "1").send("fields", maximum="much")
    assert staff.post(f"{URL}/try").status_code == 409


@pytest.mark.sweep(8)
def test_mistakes_are_not_taken(staff: Staff, folder: Path) -> None:
    Window(staff, "2").send("fields", minimum="much")
    page = staff.client.get(f"{URL}/review").text
    assert "Mistakes: 1" in page and 'name="digest"' not in page
    assert take(staff, digest="").status_code == 409 and written(folder) == FILE


@pytest.mark.sweep(8)
def test_it_is_refused_while_the_sequence_runs_and_says_so(staff: Staff, folder: Path) -> None:
    Window(staff, "2").send("fields", minimum="25")
    runtime = staff.client.app.state.runtime  # type: ignore[attr-defined]
    device = runtime.sim.devices["seq1"]
    staff.wait(asyncio.sleep, 5)
    command = runtime.plant.equipment["seq1"].type.commands["start"]
    device.write(16, plc_map.COMMAND, plc_map.request_words(Request(command.code, id=7)))
    staff.wait(asyncio.sleep, 3)
    assert device.block.state is SequenceState.RUNNING
    refused = take(staff)
    assert refused.status_code == 409 and "seq1 runs" in refused.text and written(folder) == FILE
    assert "minimum = 25" in Window(staff, "2").page


@pytest.mark.sweep(8)
def test_of_two_engineers_the_second_is_told_and_loses_nothing(staff: Staff, folder: Path) -> None:
    Window(staff, "2").send("fields", minimum="25")
    english(staff, "marko")
    Window(staff, "3").send("fields", maximum="80")
    assert take(staff, "the conveyor is faster now").status_code == 303
    english(staff, "ivana")
    page = Window(staff, "2").page
    assert "has changed since this draft was begun" in page and "minimum = 25" in page
    refused = take(staff)
    assert refused.status_code == 409 and "has changed since" in refused.text
    assert "maximum = 80" in written(folder) and "minimum = 25" not in written(folder)
    assert staff.post(f"{URL}/rebase").headers["location"] == f"{URL}/review"
    page = staff.client.get(f"{URL}/review").text
    assert "Maximum time (0 = stays): 80 → 90" in page  # what taking it would undo is said before
    assert take(staff).status_code == 303
    assert "the conveyor is faster now" in staff.client.get(f"{URL}/history").text


@pytest.mark.sweep(8)
def test_a_full_disk_leaves_the_file_whole_and_the_draft_kept(
    staff: Staff, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Window(staff, "2").send("fields", minimum="25")

    def full(handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched:
        patched.setattr(files.os, "fsync", full)
        refused = take(staff)
    assert refused.status_code == 409 and "No space left on device" in refused.text
    assert written(folder) == FILE and [one.name for one in (folder / "sequences").iterdir()] == ["feed.toml"]
    assert "minimum = 25" in Window(staff, "2").page and "needs longer" not in staff.client.get(f"{URL}/history").text
    assert take(staff).status_code == 303


@contextmanager
def closed(folder: Path, patched: pytest.MonkeyPatch) -> Iterator[None]:
    """Nobody may write in the folder: mounted read only as in a container; who may not mount has modes that count, or is told so."""

    def mount(*how: str) -> bool:
        tool = shutil.which(how[0])
        return tool is not None and subprocess.run([tool, *how[1:]], capture_output=True).returncode == 0

    if os.geteuid() != 0:
        folder.chmod(0o555)
        yield
        folder.chmod(0o755)
    elif mount("mount", "--bind", str(folder), str(folder)):
        try:
            assert mount("mount", "-o", "remount,ro,bind", str(folder))
            yield
        finally:
            assert mount("umount", str(folder))
    else:

        def refuses(path: str, flags: int, *more: object, **other: object) -> int:
            if flags & os.O_CREAT and str(path).startswith(str(folder)):
                raise OSError(errno.EROFS, os.strerror(errno.EROFS))
            return opens(path, flags, *more, **other)  # type: ignore[arg-type]

        opens, may = os.open, os.access
        patched.setattr(files.os, "open", refuses)
        patched.setattr(
            files.os, "access", lambda path, mode: not str(path).startswith(str(folder)) and may(path, mode)
        )
        yield


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("language", "way_out"),
    [("en", "An administrator"), ("hr", "Administrator mu"), ("de", "Ein Administrator"), ("cs", "Administrátor")],
)
def test_where_the_folder_is_read_only_it_says_so_before_with_the_way_out(
    staff: Staff, folder: Path, monkeypatch: pytest.MonkeyPatch, language: str, way_out: str
) -> None:
    Window(staff, "2").send("fields", minimum="25")
    open_page = staff.client.get(f"{URL}/review").text
    given = {
        name: (re.findall(rf'name="{name}"\s+value="(\w*)"', open_page) or [""])[0] for name in ("digest", "version")
    }
    assert "disabled" not in open_page.partition('name="reason"')[2]
    staff.client.cookies.set("pogon_lang", language)
    with monkeypatch.context() as patched, closed(folder / "sequences", patched):
        for page in (staff.client.get(URL).text, staff.client.get(f"{URL}/review").text):
            assert way_out in page and str(folder / "sequences") in page
        assert "disabled" in page.partition('name="reason"')[2].partition("</form>")[0]
        refused = staff.post(f"{URL}/take", {**given, "reason": "the fan needs longer", "read": "1"})
        assert refused.status_code == 409 and way_out in refused.text and written(folder) == FILE
    assert way_out not in staff.client.get(f"{URL}/review").text
    assert take(staff).status_code == 303, "as soon as it may be written"


@pytest.mark.sweep(8)
def test_a_plant_that_is_not_taken_puts_the_file_back(
    staff: Staff, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Window(staff, "2").send("fields", minimum="25")
    plant_files = staff.client.app.state.runtime.plant_files  # type: ignore[attr-defined]

    async def fails(*_given: object) -> None:
        raise RuntimeError("no")

    monkeypatch.setattr(plant_files, "_take", fails)
    refused = take(staff)
    assert refused.status_code == 409 and "the plant runs on as it is" in refused.text and written(folder) == FILE


@pytest.mark.sweep(8)
def test_a_former_revision_comes_back_as_a_new_one(staff: Staff, folder: Path) -> None:
    Window(staff, "2").send("fields", minimum="25")
    take(staff)
    back = staff.post(f"{URL}/restore", {"number": "1"})
    assert back.headers["location"] == f"{URL}/review"
    assert "Minimum time: 25 → 20" in staff.client.get(f"{URL}/review").text
    assert take(staff, "25 s was too long").headers["location"] == f"{URL}/history?done=3"
    assert written(folder) == FILE
    page = staff.client.get(f"{URL}/history?a=1&b=3").text
    assert "They say the same." in page and "as revision 1" in page
    Window(staff, "2").send("fields", minimum="26")
    assert staff.post(f"{URL}/restore", {"number": "2"}).status_code == 409
    assert staff.post(f"{URL}/restore", {"number": "9", "over": "1"}).status_code == 404


@pytest.mark.sweep(8)
def test_the_page_of_revisions_has_the_time_of_the_house_for_its_clock(staff: Staff) -> None:
    """It had the number of a revision there, or the word "file", and the clock of the page threw five times a second."""
    for _ in range(2):
        asked = {path: staff.client.get(path).text for path in ("/", f"{URL}/history")}
        times = [re.search(r'data-now="([^"]*)"', page) for page in asked.values()]
        first, second = [int(found[1]) for found in times if found is not None]
        assert 0 <= second - first < 60_000_000
        Window(staff, "2").send("fields", minimum="25")
        take(staff)


@pytest.mark.sweep(8)
def test_only_an_engineer_takes_or_goes_back(staff: Staff) -> None:
    staff.enter("operator_only", "operator")
    for path in ("review", "history"):
        assert staff.client.get(f"{URL}/{path}").status_code == 403
    for path in ("take", "restore", "try", "discard", "rebase", "fields", "text", "do", "condition"):
        assert staff.post(f"{URL}/{path}").status_code == 403
