"""How alarms stood lives on over a restart."""

from dataclasses import replace

from tests.alarms.conftest import ANA, HOT, Plot


async def test_a_restart_changes_nothing_and_tells_nothing(plot: Plot) -> None:
    alarms = [replace(HOT, key=key, latching=key in "ef") for key in "bcdef"]
    machines = list("bcdef")
    everything = [replace(one, on_delay=0.0) for one in alarms]
    engine = await plot.begin(*everything, machines=machines)
    for machine in machines:
        plot.put(machine, t=71.0)
    keep = {f"{key}.{key}" for key in "bcdef"}
    own = {one.id: one for one in engine.list.active()}
    await engine.acknowledge([own["c.c"].occurrence, own["f.f"].occurrence], ANA)
    for machine in "def":
        plot.put(machine, t=60.0)
    before = {one.id: one for one in engine.list.active()}
    assert "".join(str(before[id].state) for id in sorted(keep)) == "BCDEF"
    await engine.journal.flush()
    sounds = plot.count("sound")
    again = await plot.begin(*everything, machines=machines)
    after = {one.id: one for one in again.list.active()}
    assert after.keys() == before.keys()
    for id, one in before.items():
        assert replace(after[id], chattering=one.chattering) == one
    assert again.annunciations.count == 0
    assert plot.count("sound") == sounds
    story = await plot.story()
    assert [line for line in story if line.startswith("RAISED")] == ["RAISED AB"] * 25
    assert sum(line.startswith("RESTORED") for line in story) == len(before)
    for machine in machines:
        plot.put(machine, t=60.0)
    assert after["c.c"].id not in {one.id for one in again.list.active()}, "it goes on from where it stood"
