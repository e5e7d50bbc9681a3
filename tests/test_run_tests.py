"""`make test` runs all its stages and closes with a line that tells the truth, whatever becomes of the tests."""

import os
import re
from dataclasses import dataclass
from functools import partial
from itertools import pairwise, product
from pathlib import Path
from typing import cast

import pytest

from tests.conftest import BROWSERS, drawn
from tools.run_tests import (
    ROOT,
    SPIN,
    Result,
    Stage,
    has_room,
    main,
    report,
    run,
    side_by_side,
    stages,
    total,
    widths,
    within,
)

PASSES, FAILS = "def test_a(): pass\n", "def test_b(): assert False\n"
SKIPPED = "import pytest\n@pytest.mark.skip\ndef test_c(): pass\n"
ERRS = "import pytest\n@pytest.fixture\ndef f(): raise OSError\ndef test_d(f): pass\n"
ERRS_AFTER = "import pytest\n@pytest.fixture\ndef g():\n  yield\n  raise OSError\ndef test_e(g): pass\n"
DIES = "import os\ndef test_f(): os._exit(3)\n"
HANGS = "import time\ndef test_g(): time.sleep(60)\n"


@pytest.fixture(autouse=True)
def only_pytest(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its plugins take two seconds to come up."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")


def outcome(
    root: Path, text: str, *options: str, conftest: str = "", limit: float = 60.0, asked: bool = False
) -> Result:
    (root / "pytest.ini").write_text("[pytest]\n")
    (root / "conftest.py").write_text(conftest)
    (root / "test_x.py").write_text(text)
    return run(Stage("some", "not other", options), ["test_x.py"], ["-p", "no:cacheprovider"], asked, root, limit)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("text", "counts", "complaint"),
    [
        (PASSES, (1, 0, 0), None),
        (PASSES + SKIPPED, (1, 0, 1), None),
        (SKIPPED, (0, 0, 1), None),
        (PASSES + FAILS, (1, 1, 0), "failure: test_x.py::test_b"),
        (PASSES + ERRS, (1, 1, 0), "error: test_x.py::test_d"),
        (PASSES + ERRS_AFTER, (1, 1, 0), "error: test_x.py::test_e"),
        (PASSES + "import nothing_of_the_kind\n", (0, 1, 0), "error: "),
        (PASSES + "def test_(:\n", (0, 1, 0), "error: "),
        ("", (0, 1, 0), "no test was found"),
    ],
    ids=["passes", "skips one", "skips", "fails", "errs", "errs after", "import", "syntax", "empty"],
)
def test_a_stage_is_green_only_when_all_its_tests_ran_and_passed(
    tmp_path: Path, text: str, counts: tuple[int, int, int], complaint: str | None
) -> None:
    result = outcome(tmp_path, text)
    assert result.counts == counts
    assert [line for line in result.complaints if complaint and line.startswith(complaint)] == result.complaints
    assert bool(result.complaints) == bool(counts[1])


@pytest.mark.sweep(8)
@pytest.mark.parametrize("options", [(), ("-p", "xdist", "-n", "1")], ids=["one process", "workers"])
def test_a_process_that_dies_under_a_test_is_a_failure(tmp_path: Path, options: tuple[str, ...]) -> None:
    result = outcome(tmp_path, DIES, *options)
    assert (result.passed, bool(result.failed)) == (0, True)
    assert result.complaints


def test_a_stage_that_breaks_inside_is_a_failure(tmp_path: Path) -> None:
    result = outcome(tmp_path, PASSES, conftest="def pytest_sessionfinish(): raise SystemError\n")
    assert result.failed == 1
    assert "ended with code" in result.complaints[0]


@pytest.mark.sweep(8)
def test_a_stage_that_does_not_end_is_a_failure(tmp_path: Path) -> None:
    result = outcome(tmp_path, HANGS, limit=3.0)
    assert (result.counts, result.complaints) == ((0, 1, 0), ["not done in 3 s"])


def test_a_part_may_have_no_test_of_a_stage(tmp_path: Path) -> None:
    assert outcome(tmp_path, "", asked=True).counts == (0, 0, 0)


@pytest.mark.sweep(8)
def test_a_stage_without_what_it_needs_is_a_failure(tmp_path: Path) -> None:
    stage = Stage("some", "", needs=("false",))
    assert run(stage, ["test_x.py"], [], False, tmp_path).complaints == ["false failed, so no test ran"]


@pytest.mark.sweep(8)
def test_an_old_sheet_is_not_read(tmp_path: Path) -> None:
    assert outcome(tmp_path, PASSES).counts == (1, 0, 0)
    assert outcome(tmp_path, DIES).counts == (0, 1, 0)


def test_the_closing_line_counts_all_stages_and_stands_alone() -> None:
    results = [Result("a", 3, 1, 0, ["failure: x.py::test_a"]), Result("b", 4, 0, 2)]
    lines = report(results, "make test SEED=7")
    assert lines[-1] == "7 passed, 1 failed, 2 skipped"
    assert [line for line in lines[:-1] if line] == [
        "a:",
        "  failure: x.py::test_a",
        "In the same order: make test SEED=7",
    ]
    assert total([Result("a", 3)]) == "3 passed, 0 failed"


ALL = [stage for lane in stages(2, 3, 4) for stage in lane]


def test_every_test_is_in_exactly_one_stage() -> None:
    for soak, browser, real in product((False, True), repeat=3):
        marks = {"soak": soak, "browser": browser, "real_time": real}
        homes = [stage.name for stage in ALL if eval(stage.marks, {}, marks)]
        assert len(homes) == (0 if soak else 1), (marks, homes)


def test_every_stage_has_tests() -> None:
    assert [stage.name for stage in ALL if not within(stage, ["tests"])] == []


def test_a_stage_is_asked_only_for_files_that_speak_of_it() -> None:
    real, _, behind = ALL
    asked = ["tests/links/test_tcp.py::test_a", "tests/links/test_planner.py", "tests/sim"]
    assert within(real, asked) == [
        "tests/links/test_tcp.py::test_a",
        *(f"tests/sim/test_{name}.py" for name in ("machines", "plant", "server", "simulate_process")),
    ]
    assert within(behind, asked) == asked


@pytest.mark.sweep(8)
def test_what_several_lanes_tell_comes_one_after_the_other(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stage behind says all it has to say at once when it is done, also who failed, while the others go on."""
    monkeypatch.setattr("tools.run_tests.PATIENCE", 60)
    options = ("-p", "pytest_timeout", "-p", "no:cacheprovider", "-s")
    lanes = []
    for name, nice in (("ahead", 0), ("behind", 5)):
        root = tmp_path / name
        root.mkdir()
        (root / "pytest.ini").write_text("[pytest]\n")
        (root / "test_x.py").write_text(f"def test_a():\n  for _ in range(99): print('{name} talks')\n" + FAILS)
        stage = Stage(name, "not other", options, nice=nice)
        lanes.append([partial(run, stage, ["test_x.py"], [], False, root)])
    lanes[0].insert(0, lambda aloud: Result("first", 2))
    results = side_by_side(lanes)
    assert [(result.stage, result.counts) for result in results] == [
        ("first", (2, 0, 0)),
        ("ahead", (1, 1, 0)),
        ("behind", (1, 1, 0)),
    ]
    talk = [line.split()[-2] for line in capfd.readouterr().out.splitlines() if line.endswith("talks")]
    assert len(talk) == 2 * 99
    assert len([0 for one, following in pairwise(talk) if one != following]) == 1


@pytest.mark.parametrize(("share", "room"), [(0.97, True), (0.7, False), (0.5, False)])
def test_there_is_room_where_every_core_is_free(monkeypatch: pytest.MonkeyPatch, share: float, room: bool) -> None:
    monkeypatch.setattr("tools.run_tests.SPIN", f"print({share})")
    assert has_room(4) is room


@pytest.mark.parametrize(
    ("cores", "room", "asked", "given"),
    [
        (1, False, (None, None), (1, 1, 1)),
        (1, True, (None, None), (1, 3, 2)),
        (2, False, (None, None), (2, 2, 2)),
        (2, True, (None, None), (2, 6, 3)),
        (4, True, (None, None), (4, 8, 5)),
        (16, True, (None, None), (16, 16, 17)),
        (2, True, (1, None), (1, 1, 3)),
        (2, True, (None, 1), (2, 6, 1)),
    ],
)
def test_what_waits_has_more_processes_where_there_is_room(
    cores: int, room: bool, asked: tuple[int | None, int | None], given: tuple[int, int, int]
) -> None:
    assert widths(cores, room, *asked) == given


@pytest.mark.sweep(8)
def test_what_spins_says_how_much_of_a_core_it_got(capfd: pytest.CaptureFixture[str]) -> None:
    exec(SPIN, {})
    assert 0 < float(capfd.readouterr().out) < 1.1


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("asked", "cores", "room", "groups", "jobs"),
    [
        ([], 4, True, [[1, 2, 1]], (4, 5, 8)),
        ([], 4, False, [[4]], (4, 4, 4)),
        ([], 2, True, [[1, 1, 1], [1]], (2, 3, 6)),
        ([], 1, True, [[4]], (1, 2, 3)),
        ([], 2, False, [[4]], (2, 2, 2)),
        (["--together"], 2, False, [[1, 2, 1]], (2, 3, 6)),
        (["--apart"], 4, True, [[4]], (4, 5, 8)),
        (["--apart"], 2, True, [[4]], (2, 3, 6)),
        (["--apart"], 4, False, [[4]], (4, 4, 4)),
        (["--jobs", "1", "--browsers", "1"], 4, True, [[1, 2, 1]], (1, 1, 1)),
        (["--browsers", "4"], 2, False, [[4]], (2, 4, 2)),
        (["tests/links"], 4, True, [[3]], (4, 4, 4)),
        (["--together", "tests/links"], 2, False, [[1, 1, 1]], (2, 3, 6)),
        (["--together", "tests/blocks"], 2, False, [[2]], (2, 3, 6)),
        (["--", "-k", "tcp"], 4, True, [[4]], (4, 4, 4)),
    ],
)
def test_where_nothing_else_runs_stages_run_side_by_side(
    monkeypatch: pytest.MonkeyPatch,
    asked: list[str],
    cores: int,
    room: bool,
    groups: list[list[int]],
    jobs: tuple[int, ...],
) -> None:
    """How many stages each lane of each group has, and with how many processes."""
    seen: list[tuple[int, ...]] = []
    beside_another: list[list[int]] = []

    def chosen(*processes: int) -> list[list[Stage]]:
        seen.append(processes)
        return stages(*processes)

    def beside(several: list[list[object]]) -> list[Result]:
        beside_another.append([*map(len, several)])
        return [Result("a", 1)]

    monkeypatch.setattr("tools.run_tests.os.sched_getaffinity", lambda _: set(range(cores)))
    monkeypatch.setattr("tools.run_tests.has_room", lambda _: room)
    monkeypatch.setattr("tools.run_tests.stages", chosen)
    monkeypatch.setattr("tools.run_tests.side_by_side", beside)
    assert main(asked) == 0
    assert seen == [jobs]
    assert beside_another == groups


@pytest.mark.parametrize(
    ("asked", "draws", "again"),
    [
        ([], True, "make test SEED=7"),
        (["--all"], False, "make sweep SEED=7"),
        (["tests/links"], False, "make test SEED=7"),
        (["--", "-k", "tcp"], False, "make test SEED=7"),
        (["--", "-m", "browser"], False, "make test SEED=7"),
        (["--", "-x"], True, "make test SEED=7"),
    ],
)
def test_who_asks_for_all_or_for_a_part_gets_no_draw(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], asked: list[str], draws: bool, again: str
) -> None:
    ran: list[list[str]] = []

    def failed(stage: Stage, chosen: list[str], extra: list[str], may_be_empty: bool, aloud: bool = True) -> Result:
        ran.append(extra)
        return Result(stage.name, 1, 1, 0, ["failure: x.py::test_a"])

    monkeypatch.setattr("tools.run_tests.run", failed)
    monkeypatch.setattr("tools.run_tests.has_room", lambda _: False)
    monkeypatch.setattr("tools.run_tests._check", lambda aloud: Result("check"))
    assert main(["--seed", "7", *asked]) == 1
    assert {"--draw=7" in extra for extra in ran} == {draws}
    told = capsys.readouterr().out.splitlines()
    assert told[0] == f"The order of the tests: {again}"
    assert f"In the same order: {again}" in told


def test_of_what_sweeps_each_seed_draws_some_and_every_test_has_its_turn() -> None:
    for mark, one_in in ((pytest.mark.sweep(5).mark, 5), (pytest.mark.browser.mark, BROWSERS)):
        marked = [cast(pytest.Item, Marked(f"tests/test_x.py::test_a[{number}]", [mark])) for number in range(1000)]
        runs = [[item.nodeid for item in marked if drawn(item, seed)] for seed in range(20 * one_in)]
        assert all(0.4 < len(run) * one_in / 1000 < 1.9 for run in runs)
        assert {name for run in runs for name in run} == {item.nodeid for item in marked}
        assert [item.nodeid for item in marked if drawn(item, 3)] == runs[3]


@pytest.mark.parametrize("marks", [[], ["real_time"], ["slow"], ["browser", "always"]])
def test_what_does_not_sweep_is_in_every_draw(marks: list[str]) -> None:
    item = cast(pytest.Item, Marked("tests/test_x.py::test_a", [getattr(pytest.mark, name).mark for name in marks]))
    assert all(drawn(item, seed) for seed in range(50))


@dataclass
class Marked:
    """A test with these marks."""

    nodeid: str
    marks: list[pytest.Mark]

    def get_closest_marker(self, name: str) -> pytest.Mark | None:
        return next((mark for mark in self.marks if mark.name == name), None)


def test_a_lane_alone_is_told_as_it_goes() -> None:
    heard: list[bool] = []
    side_by_side([[lambda aloud: heard.append(aloud) or Result("a")]])
    side_by_side([[lambda aloud: heard.append(aloud) or Result("a")]] * 2)
    assert heard == [True, False, False]


def test_who_is_behind_steps_back(tmp_path: Path) -> None:
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    mine = os.nice(0)
    text = f"import os\ndef test_a(): assert os.nice(0) == {min(mine + 5, 19)}\n"
    (tmp_path / "test_x.py").write_text(text)
    stage = Stage("behind", "not other", ("-p", "pytest_timeout", "-p", "no:cacheprovider"), nice=5)
    assert run(stage, ["test_x.py"], [], False, tmp_path, aloud=False).counts == (1, 0, 0)


@pytest.mark.parametrize(
    ("chosen", "found"),
    [
        ("tests", ["tests/browser"]),
        ("tests/", ["tests/browser"]),
        ("tests/browser", ["tests/browser"]),
        ("./tests/browser/test_live.py", ["./tests/browser/test_live.py"]),
        ("tests/browser/test_live.py::test_a[x/y]", ["tests/browser/test_live.py::test_a[x/y]"]),
        (str(ROOT / "tests" / "browser"), [str(ROOT / "tests" / "browser")]),
        ("tests/web/test_api.py", []),
        ("tests/browser2", []),
    ],
)
def test_a_part_without_browser_tests_starts_no_browser(chosen: str, found: list[str]) -> None:
    assert within(ALL[1], [chosen]) == found


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("asked", "complaint"),
    [
        (["tests/test_db.py", "--", "-k", "of_no_such_name"], "no test matches tests/test_db.py -k of_no_such_name"),
        (["tests/test_no_such_file.py"], "there is no tests/test_no_such_file.py"),
        (["tests/test_db.py::test_no_such_test"], "ended with code 4"),
    ],
)
def test_a_part_that_matches_no_test_fails(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], asked: list[str], complaint: str
) -> None:
    monkeypatch.delenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD")
    monkeypatch.setattr("tools.run_tests._check", lambda aloud: Result("check"))
    monkeypatch.setattr("tools.run_tests.stages", lambda *processes: [[Stage("some", "not soak")]])
    assert main(asked) == 1
    told = capfd.readouterr().out.splitlines()
    assert told[-1] == "0 passed, 1 failed"
    assert [line for line in told if line.startswith(f"  {complaint}")]
    assert [line for line in told if re.fullmatch(r"(\w+: )?\d+ passed, \d+ failed(, \d+ skipped)?", line)] == [
        told[-1]
    ]
