"""From a change in a device to the frame in a browser, 200 browsers watching, 1 000 tags scanned every 100 ms."""

from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.common import Row, cpu_time, free_port, helper, milliseconds, percentile, write_plant

DRIVES = 40
SOCKETS = 200
SECONDS = 20.0


async def measure() -> list[Row]:
    port = free_port()
    with TemporaryDirectory() as name:
        async with helper("devices", "e800", 1.0) as devices:
            plant = write_plant(Path(name) / "plant", DRIVES, int(str(await devices.ask())))
            async with helper("server", plant, Path(name) / "data", port) as server:
                told = await server.ask("ready")
                assert isinstance(told, dict)
                async with helper("crowd", port) as browsers:
                    opened = await browsers.ask(f"open {SOCKETS} equipment/d1 {','.join(told['sids'])}")
                    assert isinstance(opened, dict) and opened["ready"] == SOCKETS, opened
                    cpu = cpu_time(server.pid)
                    seen = await browsers.ask(f"watch {SECONDS} {told['handle']}")
                    cpu = (cpu_time(server.pid) - cpu) / SECONDS
                    log = await devices.ask("log")
    assert isinstance(seen, dict) and isinstance(log, dict)
    changed = {value: moment for moment, value in log["changes"]}
    begun = min(moment for moment, _ in seen["seen"])
    first: dict[int, list[float]] = {}
    for moment, value in seen["seen"]:
        if value in changed and changed[value] > begun:
            first.setdefault(value, []).append(moment - changed[value])
    delays = [delay for arrived in first.values() for delay in sorted(arrived)[:SOCKETS]]
    middle, late = percentile(delays, 50), percentile(delays, 95)
    return [
        Row(
            "device change → frame in the browser, 100 ms scan, 200 browsers: median",
            milliseconds(middle),
            "60 ms",
            "50 ms, the scan's own",
            middle / 0.05,
            middle <= 0.06,
            f"{len(first)} changes x {SOCKETS} sockets on one machine's page, {told['tags']} tags of {DRIVES} drives behind it; "
            f"server {100 * cpu:.0f} %, browsers {100 * seen['cpu']:.0f} % of a core",
        ),
        Row(
            "the same: 95 %",
            milliseconds(late),
            "115 ms",
            "95 ms, the scan's own",
            late / 0.095,
            late <= 0.115,
        ),
    ]
