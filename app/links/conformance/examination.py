"""Every rule of the map in the order in which it is judged, and the examination that asks for all of them.

A rule is judged only when those that it needs are kept: so a server with its bytes exchanged breaks one rule and not thirty.
"""

from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from dataclasses import dataclass

from app.errors import BadAnswer, LinkError, NotConnected
from app.links.conformance import header, images, lists, writes
from app.links.conformance.finding import Broken, Finding, Skipped, State, refusal
from app.links.conformance.server import Exchange, Server
from app.links.conformance.subject import Subject
from app.plant.type_files.data import TypeData
from app.registers import plc_map

Check = Callable[[Subject], Awaitable[None]]
"""Judges one rule: returns when it is kept, raises Broken or Skipped."""


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule of the map."""

    name: str
    check: Check
    section: str = ""
    """First words of the heading in docs/registers/<type>.md; empty = before the first one."""
    needs: Sequence[str] = ()
    """Rules that must be kept before it can be judged."""
    writes: bool = False
    """It writes, and is judged only when that was asked for."""


_TYPE = ("type_code",)
_NUMBERS = ("type_code", "word_order")
RULES: Sequence[Rule] = (
    Rule("addressing", header.addressing),
    Rule("header", header.header, "Header"),
    Rule("byte_order", header.byte_order, needs=("header",)),
    Rule("magic", header.magic, "Header", ("header", "byte_order")),
    Rule("version", header.version, "Header", ("magic",)),
    Rule("type_code", header.type_code, "Header", ("version",)),
    Rule("word_order", header.word_order, needs=_TYPE),
    Rule("heartbeat", header.heartbeat, "Header", _NUMBERS),
    Rule("step_number", header.step_number, "Header", _NUMBERS),
    Rule("device_time", header.device_time, "Header", _NUMBERS),
    Rule("time_quality", header.time_quality, "Header", _TYPE),
    Rule("scan_time", header.scan_time, "Header", _TYPE),
    Rule("training", header.training, "Training", _TYPE),
    Rule("functions", header.functions, needs=_TYPE),
    Rule("counts", header.counts, needs=_TYPE),
    Rule("beyond", header.beyond, needs=_TYPE),
    Rule("images", images.images, "Image", _TYPE),
    Rule("generation", images.generation, needs=("images",)),
    Rule("swap", images.swap, needs=("generation",)),
    Rule("spare", images.spare, "Image", ("generation",)),
    Rule("values", images.values, "Image", ("generation", "word_order")),
    Rule("settings", images.settings, "Settings", ("generation", "word_order")),
    Rule("ring", lists.ring, "Events", ("generation", "word_order")),
    Rule("ring_rows", lists.ring_rows, "Events", ("ring",)),
    Rule("event_codes", lists.event_codes, "Events", ("ring_rows",)),
    Rule("event_time", lists.event_time, "Events", ("ring_rows", "device_time")),
    Rule("answers", lists.answers, "Answers", ("generation",)),
    Rule("tables", lists.tables, "Table", _NUMBERS),
    Rule("rows", lists.rows, "Table", ("tables",)),
    Rule("host_heartbeat", writes.host_heartbeat, "Header", ("heartbeat",), writes=True),
    Rule("hold", writes.hold, "Hold-to-run", _TYPE, writes=True),
    Rule("command_whole", writes.command_whole, "Commands", ("answers",), writes=True),
    Rule("command_answer", writes.command_answer, "Commands", ("answers",), writes=True),
    Rule("command_once", writes.command_once, "Commands", ("command_answer",), writes=True),
    Rule("staging", writes.staging, "Settings", ("settings",), writes=True),
    Rule("commit", writes.commit, "Settings", ("staging", "command_answer"), writes=True),
    Rule("acknowledge", writes.acknowledge, "Events", ("ring",), writes=True),
    Rule("telegram", header.telegram),
    Rule("timing", header.timing, needs=("header",)),
)
LAST = ("telegram", "timing")
"""Judged by all telegrams before them."""


async def examine(exchange: Exchange, data: TypeData, *, write: bool = False) -> AsyncIterator[Finding]:
    """Judge every rule for a server that should be a PLC of the type in `data`; without `write` nothing is written.

    Raises:
        NotConnected: the connection is gone for good.
    """
    subject = Subject(Server(exchange), data)
    found: dict[str, Finding] = {}
    for rule in RULES:
        finding = found[rule.name] = await _judge(rule, subject, found, write=write)
        yield finding


async def _judge(rule: Rule, subject: Subject, found: dict[str, Finding], *, write: bool) -> Finding:
    unmet = next((name for name in rule.needs if found[name].state is not State.KEPT), "")
    if rule.name == "hold" and not any(command.hold_bits for command in subject.kind.commands.values()):
        return Finding(rule.name, State.SKIPPED, rule.section, why="none")
    if rule.writes and not write:
        return Finding(rule.name, State.SKIPPED, rule.section, why="not_asked")
    if rule.writes and subject.first and not subject.first.words[plc_map.AT_FLAGS] & plc_map.WRITABLE:
        return Finding(rule.name, State.SKIPPED, rule.section, why="not_writable")
    if unmet and found[unmet].why == "none":  # what the type does not have has no parts either
        return Finding(rule.name, State.SKIPPED, rule.section, why="none")
    if unmet:
        return Finding(rule.name, State.SKIPPED, rule.section, why="needs", needs=unmet)
    try:
        await rule.check(subject)
    except Broken as broken:
        return Finding(rule.name, State.BROKEN, rule.section, broken.seen, broken.expected)
    except Skipped as skipped:
        return Finding(rule.name, State.SKIPPED, rule.section, why=skipped.why, needs=skipped.needs)
    except NotConnected:
        raise
    except BadAnswer:
        return Finding(rule.name, State.SKIPPED, rule.section, why="needs", needs="telegram")
    except LinkError as error:
        return Finding(rule.name, State.BROKEN, rule.section, refusal(error), "")
    return Finding(rule.name, State.KEPT, rule.section)
