"""Drive parameters on their way: all new, all former, or a mixed state that is told; whatever the drive and the line do."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import replace

import pytest

from app.access.roles import Person
from app.commands.gate import Question
from app.commands.lifecycle import Progress, ProgressState
from app.commands.orders import AuditLine
from app.commands.parameter_change import ParameterChange
from app.commands.parameter_sets import CANCELLED
from app.errors import Refused
from app.sim.bus import Answer
from app.sim.sinamics import training as own
from app.sim.sinamics.mailbox import MailboxFault
from tests.commands.stand import ANA, EVA
from tests.commands.test_gate_sinamics import Pump, pump

CONFIRMED, FAILED, UNCONFIRMED = ProgressState.CONFIRMED, ProgressState.FAILED, ProgressState.UNCONFIRMED
MAILBOX_AT = 0x0258
NEW = {"p1120": 7.5, "p1121": 8.0, "p1135": 2.5, "p0757[2]": -1.25, "p1083": 1400.0}
MANY = {"p0010": 1, **NEW, **{f"p0758[{n}]": n + 1.0 for n in range(4)}, **{f"p0760[{n}]": 50.0 + n for n in range(4)},
        **{f"p0408[{n}]": 4096 + n for n in range(3)}, **{f"p2024[{n}]": 100 + n for n in range(3)},
        "p0294": 90.0, "p1058": 100.0, "p1070": 0x0802FC01, "p0346": 0.5}  # fmt: skip


def change(it: Pump, name: str, new: float, **more: object) -> ParameterChange:
    code, _, index = name.partition("[")
    parameter = it.plant.equipment["d1"].type.drive_parameters[code]
    return ParameterChange(parameter.objects[-1], parameter, new, int(index[:-1] or 0) if index else 0, **more)  # type: ignore[arg-type]


def held(it: Pump, name: str) -> float:
    code, _, index = name.partition("[")
    return it.drive.model.values(code)[int(index[:-1]) if index else 0]


@asynccontextmanager
async def drive(transport: str = "memory", **simulation: object) -> AsyncIterator[Pump]:
    async with pump(transport, p2040=0, **simulation) as it:
        it.gate.control.release(ANA, "d1")
        it.gate.control.take(EVA, "d1")
        yield it


async def write(it: Pump, values: dict[str, float], who: Person = EVA, **asked: object) -> Progress:
    given = {"confirmed": True, "proven": True, "reason": "trial", **asked}
    nonce = it.gate.nonces.issue(who.session)
    changes = [change(it, name, new) for name, new in values.items()]
    return await it.gate.parameters.change(who, "d1", changes, nonce=nonce, **given)  # type: ignore[arg-type]


def now(it: Pump) -> dict[str, float]:
    return {name: held(it, name) for name in MANY}


def stands(progress: Progress) -> set[str]:
    return {str(one.stands) for one in progress.changes}


def check_true(it: Pump, progress: Progress) -> None:
    """What is told of each element is what the drive holds."""
    for one in progress.changes:
        name = one.key.partition(":")[2]
        told = {"new": one.new, "old": one.old, "other": one.found, "unknown": None}[str(one.stands)]
        assert told is None or held(it, name) == pytest.approx(told, rel=1e-6), (one, held(it, name))
    expected = {CONFIRMED: {"new"}, FAILED: {"old"}}.get(progress.state)
    assert expected is None or stands(progress) == expected, progress
    assert it.gate.parameters.stage("d1") is None


@pytest.mark.parametrize("transport", ["memory", "tcp", "rtu"])
async def test_all_values_are_written_and_read_back(transport: str) -> None:
    async with drive(transport) as it:
        progress = await write(it, NEW)
        assert progress.state is CONFIRMED, progress
        check_true(it, progress)
        assert {name: held(it, name) for name in NEW} == NEW
        await it.until(lambda: ("d1.drive_parameters", "confirmed") in it.lines)


async def test_a_refused_value_puts_all_back_and_has_the_error_of_the_drive() -> None:
    async with drive() as it:
        before = {name: held(it, name) for name in NEW}
        progress = await write(it, {**NEW, "p0304": 230.0})  # only while commissioning
        assert progress.state is FAILED and progress.reason == "why.set_restored", progress
        assert (progress.params["cause"], progress.params["deeper"]) == ("why.par_refused", "profidrive.error.x75")
        assert [one.error for one in progress.changes if one.code == "p0304"] == [0x75]
        check_true(it, progress)
        assert {name: held(it, name) for name in NEW} == before
        assert (await write(it, {"p0010": 1, "p0304": 230.0})).state is CONFIRMED  # what comes first counts


async def test_while_it_runs_the_drive_refuses_and_says_why() -> None:
    async with drive() as it:
        await it.done("forward", who=EVA)
        progress = await write(it, {"p1300": 21})
        assert progress.params["deeper"] == "profidrive.error.x6b" and held(it, "p1300") == 20
        assert (await write(it, {"p1120": 3.0})).state is CONFIRMED


async def test_a_value_that_the_drive_changes_is_no_success() -> None:
    async with drive() as it:
        it.drive.model._ram["p1058"] = _Stuck(it.drive.model._ram["p1058"])  # type: ignore[assignment]
        progress = await write(it, {"p1120": 9.0, "p1058": 9.0})
        assert progress.state is UNCONFIRMED and progress.reason == "why.set_mixed", progress
        assert {one.code: str(one.stands) for one in progress.changes} == {"p1120": "old", "p1058": "other"}
        check_true(it, progress)


class _Stuck(list):  # type: ignore[type-arg]
    """Takes every value as one more."""

    def __setitem__(self, at: object, values: object) -> None:
        super().__setitem__(at, [one + 1 for one in values])  # type: ignore


async def test_what_was_changed_meanwhile_is_not_written_over() -> None:
    async with drive() as it:
        nonce = it.gate.nonces.issue(EVA.session)
        seen = [change(it, "p1120", 9.0, seen=3.25)]
        with pytest.raises(Refused, match=r"why\.changed") as refused:
            await it.gate.parameters.change(EVA, "d1", seen, nonce=nonce, confirmed=True, proven=True, reason="x")
        assert refused.value.status == 409 and held(it, "p1120") == 2
        await it.until(lambda: ("d1.drive_parameters", "refused") in it.lines)


async def test_a_drive_that_goes_on_from_a_value_by_itself_is_a_success_only_where_that_is_known() -> None:
    async with drive() as it:
        it.drive.model._ram["p1058"] = _Stuck(it.drive.model._ram["p1058"])  # type: ignore[assignment]
        nonce = it.gate.nonces.issue(EVA.session)
        known = [change(it, "p1058", 9.0, becomes=(10.0,))]
        done = await it.gate.parameters.change(EVA, "d1", known, nonce=nonce, confirmed=True, proven=True, reason="x")
        assert done.state is CONFIRMED and done.changes[0].found == 10.0


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [("p1120", 651.0, "out_of_limits"), ("p1300", 20.5, "decimals"), ("p1300", 1e12, "out_of_limits"), ("r0020", 1, "x01"),
     ("p0922", 2, "no_option"), ("p0977", 1, "save_apart"), ("p0971", 1, "save_apart"), ("p2507", 2, "enc_apart"),
     ("p1120", float("nan"), "out_of_limits")],
)  # fmt: skip
async def test_what_is_not_permitted_is_refused_before_anything_is_sent(name: str, value: float, says: str) -> None:
    async with drive() as it:
        with pytest.raises(Refused, match=says):
            await write(it, {"p1121": 4.0, name: value})
        assert held(it, "p1121") == 2


async def test_only_an_engineer_in_control_with_reason_and_password() -> None:
    async with drive() as it:
        for missing, key in (("confirmed", "why.confirm"), ("reason", "why.reason"), ("proven", "why.password")):
            with pytest.raises(Question, match=key):
                await write(it, NEW, **{missing: "" if missing == "reason" else False})
        with pytest.raises(Refused, match=r"why\.role"):
            await write(it, NEW, ANA)
        it.gate.control.release(EVA, "d1")
        with pytest.raises(Refused, match=r"why\.no_token"):
            await write(it, NEW)
        it.gate.control.take(EVA, "d1")
        with pytest.raises(Refused, match=r"why\.par_count"):
            await write(it, {})
        link = replace(it.plant.links["drives"], writes=False)
        it.gate.configure(replace(it.plant, links={"drives": link}))
        with pytest.raises(Refused, match=r"why\.writes_off"):
            await write(it, NEW)
        assert held(it, "p1120") == 2


def requests_of(it: Pump, on_request: Callable[[int], None]) -> list[int]:
    """Calls `on_request` with the number of every change that comes into the mailbox; what it counts."""
    serve, seen = it.drive._mailbox._serve, [0]

    def counted(request: object) -> object:
        if getattr(request, "values", None) is not None:
            seen[0] += 1
            on_request(seen[0])
        return serve(request)  # type: ignore[arg-type]

    it.drive._mailbox._serve = counted  # type: ignore[assignment]
    return seen


@pytest.mark.parametrize("why", ["cancel", "stop", "rights"])
async def test_who_cancels_in_the_middle_gets_the_former_values(why: str) -> None:
    async with drive() as it:
        before = now(it)
        tasks = []

        def middle(number: int) -> None:
            if number != 1:
                return
            if why == "cancel":
                assert it.gate.parameters.cancel("d1") and it.gate.parameters.stage("d1")
            elif why == "stop":
                tasks.append(asyncio.create_task(it.ask("stop")))
            else:
                it.gate._state.rights = lambda person: None

        requests_of(it, middle)
        progress = await write(it, MANY)
        assert progress.state is FAILED and progress.reason == "why.set_restored", progress
        wanted = {"cancel": CANCELLED, "stop": "why.set_stopped", "rights": "why.right_ended"}[why]
        assert progress.params["cause"] in (wanted, "why.overtaken", "why.signed_out", "why.par_no_answer"), progress
        check_true(it, progress)
        assert now(it) == pytest.approx(before, rel=1e-6)
        assert not it.gate.parameters.cancel("d1")


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("fault", "gateway"),
    [
        *((fault, 0) for fault in ("LATE", "BUSY", "FOREIGN", "WRONG_LENGTH", "INTERNAL", "NEVER")),
        *((fault, 1) for fault in ("LATE", "BUSY", "NEVER", "UNREACHED", "UNANSWERED", "RESTART")),
    ],
)
async def test_a_mailbox_that_misbehaves_never_makes_a_success(fault: str, gateway: int) -> None:
    """From the first change on, for a while: then the former values are there, or it is told that they are not."""
    sure = fault == "BUSY"
    async with drive(gateway=gateway) as it:
        before = {name: held(it, name) for name in NEW}

        def spoil(number: int) -> None:
            if number == 1:
                loop = asyncio.get_running_loop()
                it.drive.write(6, own.REG_MAILBOX, [MailboxFault[fault]])
                loop.call_later(3.0, it.drive.write, 6, own.REG_MAILBOX, [0])

        requests_of(it, spoil)
        if fault == "BUSY":  # nothing is done then: it is asked again
            it.drive.write(6, own.REG_MAILBOX, [MailboxFault.BUSY])
            asyncio.get_running_loop().call_later(3.0, it.drive.write, 6, own.REG_MAILBOX, [0])
        elif fault in ("NEVER", "LATE", "INTERNAL"):
            it.drive.write(6, own.REG_MAILBOX, [0])
        progress = await write(it, NEW)
        check_true(it, progress)
        assert progress.state in ((CONFIRMED,) if sure else (CONFIRMED, FAILED)), progress
        assert {name: held(it, name) for name in NEW} == (NEW if progress.state is CONFIRMED else before)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("transport", ["memory", "tcp"])
async def test_the_line_is_cut_at_every_telegram(transport: str) -> None:
    """Cut for good, or for three seconds: all new, all former, or what nobody knows is told, and read when the drive is back."""
    telegrams, cuts = 0, 0
    while True:
        async with drive(transport) as it:
            before = now(it)
            bus, seen = it.sim.buses["drives"], [0]
            answer, back = bus.answer, [3.0 if cuts % 2 else 30.0]
            until = [float("inf")]

            def cut(
                unit: int, pdu: bytes, *, answer=answer, seen=seen, until=until, back=back, at=cuts, it=it
            ) -> Answer:  # type: ignore[no-untyped-def]
                if pdu[0] in (3, 16) and int.from_bytes(pdu[1:3], "big") == MAILBOX_AT:
                    seen[0] += 1
                    if seen[0] == at + 1:
                        until[0] = it.clock.monotonic() + back[0]
                cut_off = seen[0] > at and it.clock.monotonic() < until[0]
                return Answer(unit, None) if cut_off else answer(unit, pdu)

            bus.answer = cut  # type: ignore[method-assign]
            ends: list[Progress] = []
            it.gate.subscribe_ends(ends.append)
            try:
                progress = await write(it, MANY)
            except Refused as refused:  # cut before anything was sent
                assert refused.status in (409, 503), refused.reason
                await it.until(lambda: it.clock.monotonic() > until[0] + 5, limit=60)  # noqa: B023
                assert now(it) == pytest.approx(before, rel=1e-6)
            else:
                check_true(it, progress)
                if progress.reason == "why.set_unread":
                    assert progress.state is UNCONFIRMED and "unknown" in stands(progress)
                    await it.until(lambda: len(ends) > 1, limit=90)  # noqa: B023
                    assert ends[-1].reason.startswith("why.set_found_"), ends[-1]
                    check_true(it, ends[-1])
                else:
                    assert progress.state in (CONFIRMED, FAILED), progress
                    after = MANY if progress.state is CONFIRMED else before
                    assert now(it) == pytest.approx(after, rel=1e-6)
            telegrams = seen[0]
        if cuts >= telegrams:
            assert progress.state is CONFIRMED and cuts > 5
            return
        cuts += 1 if transport == "memory" else 3


async def test_saving_is_a_step_of_its_own_at_standstill_and_waits_until_it_is_over() -> None:
    async with drive() as it:
        await write(it, {"p1120": 9.0})

        async def save(**asked: object) -> Progress:
            nonce = it.gate.nonces.issue(EVA.session)
            given = {"confirmed": True, "proven": True, "reason": "kept", **asked}
            return await it.gate.parameters.save(EVA, "d1", nonce=nonce, **given)  # type: ignore[arg-type]

        with pytest.raises(Question, match=r"why\.password"):
            await save(proven=False)
        it.drive.model.power_up()
        assert held(it, "p1120") == 2
        await write(it, {"p1120": 9.0})
        began = it.clock.monotonic()
        progress = await save()
        assert progress.state is CONFIRMED and it.clock.monotonic() - began >= 0.5 and not it.drive.model.saving
        it.drive.model.power_up()
        assert held(it, "p1120") == 9.0
        await it.done("forward", who=EVA)
        with pytest.raises(Refused, match=r"why\.condition"):
            await save()


async def test_who_lost_control_while_it_was_written_down_saves_nothing() -> None:
    """On a slow disk the audit takes its time."""
    async with drive() as it:
        lines = it.gate.parameters._state.audit_lines
        foretell = lines._foretell

        async def slowly(line: AuditLine) -> bool:
            lines._foretell = foretell
            it.gate.control.release(EVA, "d1")
            it.gate.control.take(ANA, "d1")
            return await foretell(line)

        lines._foretell = slowly
        nonce = it.gate.nonces.issue(EVA.session)
        progress = await it.gate.parameters.save(EVA, "d1", nonce=nonce, confirmed=True, proven=True, reason="x")
        assert (progress.state, progress.reason) == (FAILED, "why.held"), progress
        assert not it.drive.model.saving


@pytest.mark.sweep(8)
async def test_a_save_that_is_never_over_or_never_answered_is_not_told_as_done() -> None:
    async with drive() as it:
        nonce = it.gate.nonces.issue(EVA.session)
        it.drive.model.step = lambda dt: None  # type: ignore[method-assign]
        progress = await it.gate.parameters.save(EVA, "d1", nonce=nonce, confirmed=True, proven=True, reason="x")
        assert progress.state is UNCONFIRMED and progress.reason == "why.par_not_saved"
        it.drive.write(6, own.REG_MAILBOX, [MailboxFault.NEVER])
        await asyncio.sleep(0.1)
        nonce = it.gate.nonces.issue(EVA.session)
        progress = await it.gate.parameters.save(EVA, "d1", nonce=nonce, confirmed=True, proven=True, reason="x")
        assert progress.state is UNCONFIRMED and progress.reason == "why.par_unknown", progress
