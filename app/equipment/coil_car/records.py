"""What the words of records.toml cannot say of coils: which of two on the line an event is about.

While the car carries one coil, the recoiler winds the next. What happens at the mandrel is about the newest, what happens to the load of
the car about the oldest, and only once the car has it. A coil that is put back onto the mandrel is the one that was taken from there.
"""

from app.records.kind import Belongs
from app.records.record import Names, Reading, Record

DROPPED = 5
"""Kind of a collision: the coil fell from the car."""
AT_MANDREL = ("winding_started", "winding_stopped", "coil_finished")


def coil_belongs(latest: Record | None, event: Reading) -> Belongs | None:
    """Where an event belongs."""
    under_way = latest is not None and latest.open
    taken = latest is not None and latest.open and latest.fields.get("taken") is not None
    match event.key:
        case "coil_on_car" if event.source:  # from a saddle: that coil was laid before
            return Belongs.NOWHERE
        case "coil_laid":
            return Belongs.HERE if taken else Belongs.NOWHERE
        case "collision":
            return Belongs.HERE if taken and event.source == DROPPED else Belongs.NOWHERE
        case "coil_on_mandrel":
            return Belongs.HERE if taken else Belongs.UNSEEN
        case key if key in AT_MANDREL and under_way and not taken:
            return Belongs.HERE
        case key if key in AT_MANDREL and under_way:  # the next one
            return Belongs.SEEN if key == "winding_started" else Belongs.UNSEEN
    return None


def coil_fold(record: Record, former: Record, event: Reading, names: Names) -> None:
    """Put back onto the mandrel, it is not taken."""
    if event.key == "coil_on_mandrel":
        record.fields["taken"] = None
