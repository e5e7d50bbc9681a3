"""A list that changed is told by a counter of its machine."""

from app.clock import ManualClock
from app.running.revisions import Revisions
from app.tags.database import Tag, TagDatabase


def test_each_change_counts_for_its_machine_alone_and_one_without_the_tag_has_none() -> None:
    tags = TagDatabase(ManualClock())
    tags.configure([Tag(name, name, "sys", 0.0) for name in ("sys.events.c1", "sys.events.c2")])
    revisions = Revisions(tags, ManualClock(), "events", 7)
    seen = []
    for machine in ("c1", "c1", "m9", "c2", "c1"):
        revisions.changed(machine)
        seen.append((tags.sample("sys.events.c1").value, tags.sample("sys.events.c2").value))
    assert seen == [(1, None), (2, None), (2, None), (2, 1), (3, 1)]


def test_two_lists_do_not_count_each_other() -> None:
    tags = TagDatabase(ManualClock())
    tags.configure([Tag(name, name, "sys", 0.0) for name in ("sys.events.c1", "sys.commands.c1")])
    events, commands = Revisions(tags, ManualClock(), "events", 1), Revisions(tags, ManualClock(), "commands", 2)
    events.changed("c1")
    events.changed("c1")
    commands.changed("c1")
    assert (tags.sample("sys.events.c1").value, tags.sample("sys.commands.c1").value) == (2, 1)
