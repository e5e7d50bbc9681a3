"""Settings that are tried when nobody knows a device: the likely ones first, each once."""

from app.links.probe import BAUDS, PARITIES, tries
from app.plant.definitions import Link


def test_the_likely_settings_are_tried_first_and_each_once() -> None:
    order = [str(one) for one in tries(Link("probe", "rtu", port="x"), BAUDS, PARITIES, [1])]
    assert order[:3] == ["9600 8E1", "19200 8E1", "38400 8E1"]
    assert order[len(BAUDS)] == "9600 8N2"
    assert len(set(order)) == len(order) == len(BAUDS) * len(PARITIES)
