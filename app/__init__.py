"""Pogon: an open web HMI/SCADA for drives, conveyors, cranes and step sequences."""

from pathlib import Path

__version__ = "0.1.0"


def bundled(name: str) -> Path:
    """A folder of ours (`templates`, `static`, `migrations`, `plants/demo`): in a checkout beside `app`, in a wheel inside it."""
    package = Path(__file__).resolve().parent
    beside = package.parent / name
    return beside if beside.exists() else package / "_data" / name
