"""Orders and points of other machines in a sequence file: everything wrong is named with what was expected, before anything runs."""

from pathlib import Path

import pytest

from app.plant.loader import read_plant
from app.plant.sequence_plant import others, own
from tests.running.test_sequence_orders import FEED, PLANT


def problems(folder: Path, work: str = FEED, plant: str = PLANT) -> list[str]:
    (folder / "sequences").mkdir(parents=True)
    (folder / "plant.toml").write_text(plant, "utf-8")
    (folder / "sequences" / "work.toml").write_text(work, "utf-8")
    return [f"{one.key} = {one.value}: {one.expected}" for one in read_plant(folder)[1]]


def test_a_right_one_has_none(tmp_path: Path) -> None:
    assert problems(tmp_path / "hall") == []


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('machine = "m1"', 'machine = "m3"', "another equipment that takes orders: one of c1, m1, m2"),
        ('action = "run_forward"', 'action = "run_forwards"', "perhaps run_forward"),
        ("frequency = 30", "frequency = 5000", "a number from 0 to 650 for m1"),
        ("{ frequency = 30 }", "{}", "a number: run_forward needs frequency"),
        ("{ frequency = 30 }", "{ frequency = 30, speed = 3 }", "a value of run_forward: one of frequency"),
        ("m1.status != 4", "m1.status != 77", "a choice that m1.status has: "),
        ("m1.status != 4", "m1.statsu != 4", "it has no statsu (perhaps m1.status)"),
        ("m1.status != 4", "m9.status != 4", "points of equipment of the plant; m9 is none"),
        ('value = "m1.frequency"', 'value = "m1.frequencies"', "perhaps m1.frequency"),
        ('label = "Feed"\n', 'label = "Feed"\nstart_when = "c7.moving == 1"\n', "c7 is none"),
    ],
)
def test_what_is_wrong_is_told(tmp_path: Path, old: str, new: str, told: str) -> None:
    assert old in FEED
    found = problems(tmp_path / "hall", FEED.replace(old, new, 1))
    assert len(found) == 1 and told in found[0], found


def test_what_the_server_runs_moves_nothing_on_a_live_link(tmp_path: Path) -> None:
    live = PLANT.replace(
        '[links.drives]\ntransport = "memory"', '[links.drives]\ntransport = "tcp"\nhost = "10.0.0.1"\nwrites = true'
    )
    found = problems(tmp_path / "hall", plant=live)
    assert len(found) == 2 and all("moves nothing on a live link" in one for one in found), found
    believed = live.replace("writes = true", "writes = true\nsimulated = true")
    assert problems(tmp_path / "believed", plant=believed) == []


def test_a_sequence_with_a_plc_of_its_own_gives_no_orders(tmp_path: Path) -> None:
    live = PLANT.replace(
        '[links.line]\ntransport = "memory"', '[links.line]\ntransport = "tcp"\nhost = "10.0.0.1"\nwrites = true'
    )
    assert all("has a PLC of its own" in one for one in problems(tmp_path / "hall", plant=live))


def test_tests_of_a_file_with_orders_are_refused_not_left_out(tmp_path: Path) -> None:
    work = FEED + '[[tests]]\nname = "a"\nthen = [{ within = 1, state = "done" }]\n'
    assert any("no tests where steps have orders" in one for one in problems(tmp_path / "hall", work))


def test_names_with_a_machine_are_of_the_plant() -> None:
    assert (own(["a", "m1.a"]), others(["a", "m1.a"])) == (["a"], ["m1.a"])


FEEDS = FEED.replace('machine = "c1"\naction = "start"\n', 'machine = "c1"\naction = "feed"\nvalues = { count = N }\n')
NUMBER = '[[recipe]]\nkey = "n"\nlabel = "n"\nminimum = 1\nmaximum = {most}\ndefault = 2\ndecimals = {decimals}\n'


@pytest.mark.parametrize(
    ("given", "decimals", "most", "told"),
    [
        ("3", 0, 9, ""),
        ("0", 0, 9, "a number from 1 to 10000 for c1"),
        ("2.5", 0, 9, "a whole number"),
        ('"recipe.n"', 0, 9, ""),
        ('"recipe.n"', 1, 9, "in whole numbers, with decimals = 0"),
        ('"recipe.n"', 0, 20000, "a number from 1 to 10000 for c1"),
    ],
)
def test_a_value_that_an_action_reads_itself_is_a_number_or_one_of_the_run(
    tmp_path: Path, given: str, decimals: int, most: int, told: str
) -> None:
    work = FEEDS.replace("= N", f"= {given}") + NUMBER.format(decimals=decimals, most=most)
    found = problems(tmp_path, work)
    assert len(found) == bool(told) and told in "".join(found), found
