"""The structured text of docs/plc run: the registers are those of the type's data, `pogon conform` finds nothing, blocks do as ours do."""

import asyncio
import random
from struct import pack
from typing import Any
from zlib import crc32

import pytest

from app.blocks.parameter_gateway import Bus, ParameterGateway
from app.blocks.s_ramp import SRamp
from app.blocks.sequence import ALL, SequenceBlock, SequenceSettings, Signals, StepSettings
from app.links.conformance.finding import State
from app.registers import plc_map
from app.registers.codec import decode
from app.registers.register import Register, Type
from tests.links.conformance.servers import KINDS, data_of, judged, rules_in
from tests.plc_text.plc import TextPlc, block, program
from tools import plc_text


def given(points: list[tuple[str, Register]]) -> tuple[dict[str, Any], dict[str, float]]:
    """Inputs of a block that writes `points`, each a number of its own, and what the points then are."""
    inputs: dict[str, Any] = {}
    numbers: dict[str, float] = {}
    for n, (key, register) in enumerate(points, 1):
        if register.mask is not None:
            inputs[f"p_{key}"] = numbers[key] = register.mask if n % 2 else 0
        elif register.type is Type.U64:
            inputs[f"p_{key}_high"], inputs[f"p_{key}_low"] = n, 0x80000000 + n
            numbers[key] = (n << 32) + 0x80000000 + n
        else:
            value = {Type.F32: 0.5 - n, Type.I32: -100_000 - n, Type.U32: 100_000 * n + 65_537}.get(
                register.type, 1000 + n
            )
            inputs[f"p_{key}"] = numbers[key] = value
    return inputs, numbers


@pytest.mark.parametrize("kind", KINDS)
def test_every_word_of_an_image_and_of_a_row_is_where_the_data_have_it(kind: str) -> None:
    data = data_of(kind)
    assert data.type.device.plc
    for image in data.type.device.plc.images:
        regs = program().initial("PogonRegisters")
        points = plc_text.written(data.type.points.values(), image.address, image.words)
        inputs, numbers = given(points)
        block(plc_text.block_name(data.type, f"{image.address:04X}"))(**inputs, Regs=regs)
        check(points, numbers, regs.W)
        assert regs.W[image.address] == regs.W[image.address + image.words - 1] == 2
        touched = {n for n, word in enumerate(regs.W) if word}
        assert touched <= set(range(image.address, image.address + image.words))
    for key, table in data.type.tables.items():
        regs = program().initial("PogonRegisters")
        first = table.address + plc_map.TABLE_HEAD
        points = plc_text.written((cell.point for cell in data.columns[key].values()), first, table.row)
        inputs, numbers = given(points)
        block(plc_text.block_name(data.type, key))(Slot=1, **inputs, Regs=regs)
        check(points, numbers, regs.W)
        assert regs.W[first + plc_map.ROW_GENERATION] == regs.W[first + table.row - 1] == 2
        block(plc_text.block_name(data.type, key))(Slot=3, **inputs, Regs=regs)
        row = slice(first + 2 * table.row, first + 3 * table.row)
        assert regs.W[row] == regs.W[first : first + table.row]


def check(points: list[tuple[str, Register]], numbers: dict[str, float], words: list[int]) -> None:
    for key, register in points:
        raw = Register(register.address, register.type, mask=register.mask, shift=register.shift, words=register.words)
        assert decode(raw, words[register.address : register.address + register.words]) == numbers[key], key


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
async def test_a_plc_of_these_blocks_keeps_every_rule(kind: str) -> None:
    plc = TextPlc(kind)
    plc.events = [{"Code": min(plc.data.type.events), "Source": n} for n in range(3)]
    plc.scan()
    task = asyncio.create_task(plc.run())

    async def exchange(pdu: bytes) -> bytes:
        return plc.answer(pdu)

    found = await judged(exchange, kind)
    task.cancel()
    assert not rules_in(found, State.BROKEN), [finding for finding in found.values() if finding.state is State.BROKEN]
    assert {found[rule].why for rule in rules_in(found, State.SKIPPED)} <= {"none", "nothing", "needs"}
    assert len(rules_in(found, State.KEPT)) >= 35 and not plc.taken


def test_a_command_is_taken_once_and_its_answers_are_kept() -> None:
    plc = TextPlc("conveyor")
    plc.scan()
    assert plc.ask(1, 500, 7, 9)[:3] == [500, 3, 0]
    assert plc.taken == [(1, [7, 9, 0, 0], 500)]
    assert plc.ask(1, 500)[:3] == [500, 3, 0] and len(plc.taken) == 1, "the same id"
    assert plc.ask(2, 501, expected=5)[:4] == [501, 4, 2, 0], "another state than the person saw"
    assert plc.ask(999, 502)[:3] == [502, 4, 1]
    for n in range(8):
        plc.ask(2, 600 + n)
    assert [plc.regs.W[0x0321 + 8 * n] for n in range(8)] == [607 - n for n in range(8)]
    assert plc.ask(2, 604)[0] == 607 and len(plc.taken) == 9, "remembered, though not the newest"


def test_settings_are_taken_as_a_whole_or_not_at_all() -> None:
    plc = TextPlc("conveyor")
    plc.scan()
    words = plc.regs.W[0x0202:0x0220]
    assert plc.settings.Value[1] == 30.0 and plc.regs.W[0x0240:0x025E] == words

    def commit(id: int, staged: list[int], count: int = 30, wrong: int = 0) -> list[int]:
        plc.regs.W[0x0240:0x025E] = staged
        return plc.ask(0xF0, id, count, crc32(pack(">30H", *staged)) ^ wrong)[1:4]

    other = [*words[:2], *plc_map.long_words(plc_map.real(25.0)), *words[4:]]
    assert commit(1, other, count=28) == [4, 20, 30]
    assert commit(2, other, wrong=1) == [4, 22, 0]
    beyond = [*other[:6], *plc_map.long_words(plc_map.real(9.0)), *other[8:]]
    assert commit(3, beyond) == [4, 21, 4]
    not_a_number = [*other[:6], 0x7FC0, 0, *other[8:]]
    assert commit(4, not_a_number) == [4, 21, 4]
    assert plc.regs.W[0x0202:0x0220] == words
    assert commit(5, other) == [3, 0, 0]
    assert plc.settings.Changed and plc.settings.Value[2] == 25.0 and plc.regs.W[0x0202:0x0220] == other


def test_the_ring_goes_round_and_knows_what_is_stored() -> None:
    plc = TextPlc("conveyor")
    for n in range(70):
        plc.events = [{"Code": 1, "Source": n, "Value": n / 2, "Snapshot": dict.fromkeys(range(6), n), "Cause": n}]
        plc.scan()
    head = plc.regs.W[0x0400:0x040A]
    assert head[1:7] == [59, 17, 0, 12, 0, 70] and head[0] == head[9]
    event = plc_map.event_of(plc.regs.W[0x0410 + 70 % 59 * 17 :][:17])
    assert (event.sequence, event.code, event.source, event.value, event.snapshot, event.request) == (
        70,
        1,
        69,
        34.5,
        (69,) * 6,
        69,
    )
    assert event.time == 70 * 20_000
    plc.regs.W[0x0407:0x0409] = [0, 66]
    plc.scan()
    assert plc.ring.Acknowledged == 66
    plc.regs.W[0x0407:0x0409] = [0, 99]
    plc.scan()
    assert plc.ring.Acknowledged == 0, "nobody has stored what was not told"


def test_a_button_counts_for_500_ms() -> None:
    plc = TextPlc("conveyor")
    plc.scan()
    plc.regs.W[0x0380:0x0384] = [1, 5, *plc_map.long_words(plc_map.real(12.5))]
    counted = 0
    for _ in range(60):
        plc.scan()
        counted += plc.hold.Bits == 1
    assert counted * 20 == 520 and plc.hold.Argument == 12.5
    plc.regs.W[0x0381] = 6
    plc.scan()
    assert plc.hold.Bits == 1


def test_time_and_steps_carry_into_the_upper_half() -> None:
    header, regs = block("PogonHeader"), program().initial("PogonRegisters")
    header.KeptLow, header.StepLow = 0xFFFFFFF0, 0xFFFFFFFF
    header(CycleMicros=0x20, HostTimeout=100, Regs=regs)
    assert (header.TimeHigh, header.TimeLow) == (1, 0x10)
    assert regs.W[0:3] == [plc_map.MAGIC, plc_map.MAJOR, plc_map.MINOR]
    assert regs.W[11:15] == [0, 1, 0, 0x10] and regs.W[19:23] == [0, 1, 0, 0]
    assert not header.HostSilent
    header(CycleMicros=200_000, MapMinor=1, Regs=regs)
    assert header.HostSilent and regs.W[2] == 1
    regs.W[9] = 77
    header(CycleMicros=200_000, Regs=regs)
    assert not header.HostSilent


def test_the_s_ramp_goes_as_ours_does() -> None:
    chance, text, ours = random.Random(3), block("PogonSRamp"), SRamp(60.0, 240.0)
    target = 0.0
    for n in range(4000):
        if n % 41 == 0:
            target = chance.choice((0.0, chance.uniform(-100, 100)))
            ours.acceleration_limit, ours.jerk = chance.uniform(20, 90), chance.uniform(50, 500)
        text(Target=target, Limit=ours.acceleration_limit, Jerk=ours.jerk, Cycle=0.01)
        out = ours.step(target, 0.01)
        assert (text.Speed, text.Acceleration) == pytest.approx((out.speed, out.acceleration), abs=1e-9)
        assert text.Done == out.done
    text(Target=1.0, Limit=0.0, Jerk=1.0, Cycle=0.01)
    assert text.Fault and not text.Done


def test_the_sequence_goes_as_ours_does() -> None:
    """Random signals by seed: state, step, first-out and what a start says are the same in every scan."""
    states, causes = set(), set()
    for seed in range(12):
        chance = random.Random(seed)
        steps = [
            StepSettings(
                minimum=chance.choice((0, 0.1)),
                maximum=chance.choice((0.2, 0.4, 2.0)),
                loss_aborts=chance.random() < 0.4,
            )
            for _ in range(4)
        ]
        ours, text = SequenceBlock(SequenceSettings(steps=tuple(steps))), block("PogonSequence")
        for n, step in enumerate(steps, 1):
            one = text.Setting[n]
            one.Minimum, one.Maximum, one.LossAborts = (
                round(step.minimum * 1e6),
                round(step.maximum * 1e6),
                step.loss_aborts,
            )
        now, stuck = 0, 0
        for _ in range(600):
            now += 20_000
            words = [ALL if chance.random() < 0.93 else ALL & ~(1 << chance.randrange(16)) for _ in steps]
            stuck = max(0, stuck - 1) or (60 if chance.random() < 0.01 else 0)
            if stuck:
                words[2] = 0xFFF7
            healthy = ALL if chance.random() < 0.99 else ALL & ~(1 << chance.randrange(16))
            start, suspend, stop, acknowledge = (chance.random() < odds for odds in (0.3, 0.1, 0.01, 0.2))
            reports = ours.scan(
                Signals(
                    permissives=tuple(words),
                    abort=healthy,
                    start=start,
                    suspend=suspend,
                    abort_request=stop,
                    acknowledge=acknowledge,
                ),
                0.02,
                now,
            )
            text(
                Steps=4, Permissive=dict(enumerate(words, 1)), Healthy=healthy, Start=start, Suspend=suspend, AbortRequest=stop,
                Acknowledge=acknowledge, CycleMicros=20_000,
            )  # fmt: skip
            assert (text.State, text.Step) == (int(ours.state), ours.step)
            assert text.NeedsAcknowledge == ours.needs_acknowledge
            assert text.StartRefused == any(report.event.name == "START_REFUSED" for report in reports)
            states.add(text.State)
            causes.add(text.Cause)
    assert states == {0, 1, 2, 3, 4, 5} and causes >= {0, 1, 2, 3, 4}


def line(**more: Any) -> dict[str, Any]:
    fixed = {
        "PulseLength": 0.5, "Sensors": 3, "Sensor": {1: 100.0, 2: 300.0, 3: 600.0, **dict.fromkeys(range(4, 9), 0.0)},
        "Tolerance": 8.0, "AlarmTolerance": 2.0, "LostAfter": 10.0, "LineEnd": 700.0,
    }  # fmt: skip
    return fixed | more


def test_products_are_tracked_measured_put_right_lost_and_let_go() -> None:
    """A belt that slips by 1 %: what really lies there cuts the beams, the block has only its pulses."""
    text, products = block("PogonTracking"), [0.0, -90.0, -200.0]
    taken_away, seen_full = 2, []
    for scan in range(1900):
        travelled = scan * 0.5 * 0.99
        heads = [start + travelled for start in products]
        if heads[taken_away] > 400:
            heads[taken_away] = -1000.0
        beams = {
            n: any(head - 40.0 < place <= head for head in heads) for n, place in ((1, 100.0), (2, 300.0), (3, 600.0))
        }
        text(**line(Pulses=scan, Beam={**beams, **dict.fromkeys(range(4, 9), False)}))
        tracked = [one for one in text.Product.values() if one.Id and one.State == 1]
        for one in tracked:
            assert one.Length == pytest.approx(40.4, abs=0.6)
            assert one.Head - one.Tail == pytest.approx(one.Length, abs=1e-3)
            if heads[one.Id - 1] > 0:
                assert one.Head == pytest.approx(heads[one.Id - 1], abs=3.6), "no further than the slip between sensors"
        seen_full.append(text.Count)
    assert (text.Entered, text.LeftCount, text.LostCount, text.Unexpected) == (3, 2, 1, 0)
    (gone,) = (one for one in text.Product.values() if one.Id)
    assert (gone.Id, gone.State, gone.CorrectedAt) == (3, 5, 2)
    assert max(seen_full) == 3


def test_a_wrap_of_the_encoder_is_no_jump() -> None:
    text = block("PogonTracking")
    beams = dict.fromkeys(range(1, 9), False)
    text(**line(Pulses=0x7FFFFFFE, Beam=beams))
    text(**line(Pulses=0x7FFFFFFF, Beam={**beams, 1: True}))
    text(**line(Pulses=-0x80000000, Beam={**beams, 1: True}))
    assert text.Product[1].Head == pytest.approx(100.5)


def test_the_gateway_goes_as_ours_does() -> None:
    """Random requests, rubbish and answers, with a restart: the same registers, the same blocks that run, scan for scan."""
    chance = random.Random(11)
    ours, theirs = ParameterGateway(), block("PogonGateway")
    regs, record = program().initial("PogonRegisters"), program().initial("PogonRecord")
    for _ in range(3000):
        if chance.random() < 0.01:
            window = ours.window
            ours, theirs = ParameterGateway(), block("PogonGateway")
            ours.window[:] = window
        if chance.random() < 0.2:
            length = chance.choice((0, 3, 4, 10, 12, 238, 240, 250))
            words = [chance.choice((0, 1, 1, 1, 2)), chance.choice((0x2F00, 0x2F00, 0x2E00)) | length]
            words += [chance.randrange(0x10000) for _ in range(chance.randrange(120))]
            ours.window[: len(words)] = words
            regs.W[600 : 600 + len(words)] = words
        kinds = ["write_done", "write_error", "write_refused", "read_done", "read_error", "not_ready"]
        flags = {kind: chance.random() < 0.4 for kind in kinds}
        flags["write_error"] &= not flags["write_done"]
        answer = tuple(chance.randrange(0x10000) for _ in range(120))
        length = chance.choice((0, 6, 7, 8, 240, 255))
        if theirs.ReadRecord:
            record.W.update(enumerate(answer))
        now = ours.scan(Bus(**flags, answer=answer, length=length))
        theirs(
            First=600, WriteDone=flags["write_done"], WriteError=flags["write_error"], WriteRefused=flags["write_refused"],
            ReadDone=flags["read_done"], ReadError=flags["read_error"], NotReady=flags["not_ready"], Length=length,
            Regs=regs, Record=record,
        )  # fmt: skip
        assert (theirs.WriteRecord, theirs.ReadRecord) == (now.write, now.read)
        assert list(regs.W[600:722]) == ours.window
        if now.write:
            assert tuple(record.W[n] for n in range(len(ours.record))) == ours.record and theirs.Bytes == ours.length
