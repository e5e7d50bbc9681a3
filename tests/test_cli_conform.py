"""pogon conform from the terminal, over a socket."""

import json
import re
import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

from app.links.conformance.finding import WORDS
from app.plant import types
from app.plant.texts import Texts
from app.sim.bus import Bus
from app.sim.server import serve_tcp
from tests.links.conformance.servers import simulation
from tests.links.devices import RegisterDevice
from tests.test_cli_probe import pogon
from tests.test_docs import COMMANDS

pytestmark = pytest.mark.real_time

CONVEYOR = ["--tcp", "127.0.0.1:502", "--type", "conveyor"]


async def test_a_simulated_plc_is_examined_in_lines_and_in_json() -> None:
    plant = simulation()
    bus = plant.buses["line"]
    served = await serve_tcp(bus, "127.0.0.1", 0)
    where = "{}:{}".format(*served.address)
    asked = ("conform", "--tcp", where, "--unit", "11", "--type", "conveyor")
    # nobody steps it: a program that stands still is a broken rule, and the exit code says so
    code, output, _ = await pogon(*asked, "--language", "de")
    assert code == 1
    assert "VERLETZT: heartbeat: Wort 8 des Kopfes steigt in jedem Zyklus um 1\n    gesehen: 0x0008 = " in output
    assert "siehe docs/registers/conveyor.md: Header" in output
    assert "; erwartet: mit jedem Zyklus 1 mehr; " in output and not re.search(r"\{\w+\}", output)
    assert "eingehalten: magic: Wort 0 des Kopfes ist die Kennzahl\n" in output
    assert "nicht geprüft: hold: " in output and "(nur mit --write)" in output
    code, output, _ = await pogon(*asked, "--json")
    told = json.loads(output)
    assert code == 1 and not told["ok"]
    assert (told["server"], told["unit"], told["type"], told["wrote"]) == (where, 11, "conveyor", False)
    by_rule = {rule["rule"]: rule for rule in told["rules"]}
    assert by_rule["heartbeat"]["state"] == "broken" and by_rule["heartbeat"]["expected"] == "1 more with each scan"
    assert by_rule["magic"]["state"] == "kept" and "seen" not in by_rule["magic"]
    assert by_rule["hold"]["why"] == "not_asked"
    code, output, _ = await pogon(*asked[:-1], "crane", "--json")
    wrong = {rule["rule"]: rule for rule in json.loads(output)["rules"]}["type_code"]
    assert code == 1 and (wrong["seen"], wrong["expected"]) == ("0x0003 = 10", "40")
    await served.close()


def test_what_stands_between_numbers_is_said_in_every_language() -> None:
    texts = Texts.read()
    for language in texts.languages:
        said = [texts.text(language, f"conform.word.{word}") for word in WORDS]
        assert len(set(said)) == len(WORDS) and not [one for one in said if "[" in one or "{" in one]


async def test_a_device_that_is_no_plc_has_no_header() -> None:
    served = await serve_tcp(Bus({1: RegisterDevice({0x1000: 1})}), "127.0.0.1", 0)
    code, output, _ = await pogon("conform", "--tcp", "{}:{}".format(*served.address), "--type", "crane", "--json")
    rules = {rule["rule"]: rule for rule in json.loads(output)["rules"]}
    assert code == 1
    assert rules["header"]["seen"] == "0x0000–0x001F: exception 02"
    assert {rule["state"] for name, rule in rules.items() if name not in ("header", "telegram")} == {"skipped"}
    await served.close()
    code, _, errors = await pogon("conform", "--tcp", "{}:{}".format(*served.address), "--type", "crane")
    assert code == 2 and "no connection" in errors


async def test_a_type_of_a_plant_folder_is_examined_as_ours_are(tmp_path: Path) -> None:
    shutil.copytree(types.EQUIPMENT / "conveyor", tmp_path / "equipment" / "line2")
    bus = simulation().buses["line"]
    served = await serve_tcp(bus, "127.0.0.1", 0)
    asked = ("conform", "--tcp", "{}:{}".format(*served.address), "--unit", "11", "--plant", str(tmp_path), "--json")
    code, output, errors = await pogon(*asked, "--type", "line2")
    rules = {rule["rule"]: rule for rule in json.loads(output)["rules"]}
    assert code == 1 and rules["magic"]["state"] == "kept" and rules["type_code"]["state"] == "kept", errors
    assert rules["heartbeat"]["documented"].startswith("equipment/line2")
    assert json.loads((await pogon(*asked, "--type", "conveyor"))[1])["type"] == "conveyor"
    await served.close()
    head = tmp_path / "equipment" / "line2" / "device.toml"
    head.write_text(head.read_text("utf-8").replace("type_code = 10", "type_kode = 10"), "utf-8")
    code, _, errors = await pogon(*asked, "--type", "line2")
    assert code == 2 and "equipment/line2/device.toml" in errors and "type_kode" in errors
    code, _, errors = await pogon(*asked[:-3], "--plant", str(tmp_path / "none"), "--type", "line2")
    assert code == 2 and "none: expected a plant folder with equipment/<type>/device.toml" in errors


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--tcp", "nowhere", "--type", "crane"], "--tcp nowhere: expected HOST:PORT"),
        (["--tcp", "127.0.0.1:0", "--type", "crane"], "expected the port that is really open"),
        (["--tcp", "127.0.0.1:502", "--type", "eura_e800"], "expected one of coil_car, conveyor, crane, sequence"),
        (["--tcp", "127.0.0.1:502", "--type", "crane", "--language", "fr"], "--language fr: expected one of"),
        ([*CONVEYOR, "--option", "merges"], "--option merges: expected NAME=NUMBER, such as belts=5"),
        ([*CONVEYOR, "--option", "merges=x"], "--option merges=x: expected NAME=NUMBER"),
        ([*CONVEYOR, "--option", "merges=5"], "--option merges=5: expected a whole number from 0 to 4"),
        ([*CONVEYOR, "--option", "merges=0.5"], "--option merges=0.5: expected a whole number from 0 to 4"),
        ([*CONVEYOR, "--option", "lanes=1"], "expected one of belts, gates, merges, scanner, sensors"),
        (["--tcp", "127.0.0.1:502", "--type", "crane", "--option", "merges=1"], "expected none: a crane has no such"),
    ],
)
async def test_what_makes_no_sense_is_told_and_not_tried(arguments: Sequence[str], told: str) -> None:
    code, output, errors = await pogon("conform", *arguments)
    assert (code, output) == (2, "") and told in errors


def test_every_rule_and_every_reason_has_its_sentence_in_every_language() -> None:
    from app.links.conformance.examination import RULES

    texts = Texts.read()
    keys = [f"rule.{rule.name}" for rule in RULES]
    keys += [f"why.{why}" for why in ("needs", "none", "nothing", "own_reason", "not_asked", "not_writable")]
    keys += ["seen", "summary", *(f"state.{state}" for state in ("kept", "broken", "skipped"))]
    for lang in texts.languages:
        assert [key for key in keys if not texts.has(lang, f"conform.{key}")] == []
    assert "conform" in COMMANDS.commands
