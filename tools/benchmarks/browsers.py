"""What browsers cost the server: 200 with all values of 1 000 tags, 1 000 with the page of one machine; its memory."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.common import Helper, Row, cpu_time, free_port, helper, milliseconds, resident, thousands, write_plant

DRIVES = 40
SMALL = 10
SECONDS = 8.0


async def _load(
    server: Helper, crowd: Helper, told: dict[str, Any], sockets: int, kind: str
) -> tuple[dict[str, float], float]:
    """What the browsers got, and the CPU share of the server meanwhile."""
    opened = await crowd.ask(f"open {sockets} {kind} {','.join(told['sids'])}")
    assert isinstance(opened, dict) and opened["ready"] == sockets, opened
    before = cpu_time(server.pid)
    got = await crowd.ask(f"measure {SECONDS}")
    share = (cpu_time(server.pid) - before) / SECONDS
    assert isinstance(got, dict)
    return got, share


async def _bare(sockets: int, size: int, rate: float) -> float:
    """CPU share of asyncio that sends bytes of the same size to as many sockets."""
    port = free_port()
    async with helper("broadcast", port, size, rate) as sender:
        await sender.ask()
        async with helper("crowd", port) as crowd:
            await crowd.ask(f"open {sockets}")
            before = cpu_time(sender.pid)
            await crowd.ask("measure 4")
            return (cpu_time(sender.pid) - before) / 4


async def _memory() -> tuple[float, int]:
    """Memory of a server with about 1 000 tags and 50 browsers after a while [MB], and the number of tags."""
    port = free_port()
    with TemporaryDirectory() as name:
        async with helper("devices", "e800", 1.0) as devices:
            plant = write_plant(Path(name) / "plant", SMALL, int(str(await devices.ask())))
            async with helper("server", plant, Path(name) / "data", port) as server, helper("crowd", port) as crowd:
                told = await server.ask("ready")
                assert isinstance(told, dict)
                await _load(server, crowd, told, 50, "overview")
                return resident(server.pid), int(told["tags"])


async def measure() -> list[Row]:
    small, small_tags = await _memory()
    port = free_port()
    with TemporaryDirectory() as name:
        async with helper("devices", "e800", 1.0) as devices:
            plant = write_plant(Path(name) / "plant", DRIVES, int(str(await devices.ask())))
            async with helper("server", plant, Path(name) / "data", port) as server, helper("crowd", port) as crowd:
                told = await server.ask("ready")
                assert isinstance(told, dict)
                before = cpu_time(server.pid)
                await crowd.ask("measure 4")
                alone = (cpu_time(server.pid) - before) / 4
                await _load(server, crowd, told, 50, "overview")
                memory = resident(server.pid)
                all_values, cost = await _load(server, crowd, told, 150, "overview")
                await crowd.ask("close")
                one_machine, one_cost = await _load(server, crowd, told, 1000, "equipment/d1")
                await crowd.ask("close")
    frames = all_values["frames"] / all_values["seconds"]
    size, rate = all_values["bytes"] / all_values["frames"], frames / 200
    bare = await _bare(200, round(size), rate)
    per_frame = all_values["values"] / max(1, all_values["frames"] / 200)
    own = cost - alone
    limit = "the browsers' process was the limit" if one_machine["cpu"] > 0.9 else "nothing was at its limit"
    if one_cost > 0.9:
        limit = "the server's core was the limit"
    return [
        Row(
            "browsers: 200 x 1 000 tags x 10 Hz, CPU share of the server for them",
            f"{100 * own:.0f} % of a core",
            "25 %",
            f"{100 * bare:.0f} %, asyncio sending as many bytes",
            own / bare if bare else None,
            own <= 0.25,
            f"{rate:.1f} frames/s each of {size / 1000:.0f} KB, {thousands(rate * per_frame)} changed values/s; the server alone "
            f"{100 * alone:.0f} %; the browsers' process took {100 * all_values['cpu']:.0f} %",
        ),
        Row(
            "browsers: 1 000 with the page of one machine x 10 Hz, 99 % of the frames within",
            milliseconds(one_machine["p99"]),
            "250 ms",
            "",
            None,
            one_machine["p99"] <= 0.25,
            f"from encoding to arrival, median {milliseconds(one_machine['median'])}, "
            f"{one_machine['frames'] / one_machine['seconds'] / 1000:.1f} frames/s each; server {100 * one_cost:.0f} %, browsers "
            f"{100 * one_machine['cpu']:.0f} % of a core: {limit}. A server of the product takes {500} sockets; here it was let take more",
        ),
        Row(
            "memory with 1 000 tags at 100 ms and 50 browsers",
            f"{small:.0f} MB",
            "120 MB",
            "",
            None,
            small <= 120,
            f"resident, {small_tags} tags of {SMALL} drives, all on each page; {memory:.0f} MB with {told['tags']} tags of {DRIVES} drives",
        ),
    ]
