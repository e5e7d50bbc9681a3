"""Pogon: an open web HMI/SCADA for drives, conveyors, cranes and step sequences."""

__version__ = "0.1.0"
