"""A positioner on a simulated axis."""

from app.sim.crane.axis import AxisData
from app.sim.crane.figures import HOIST, TROLLEY

TROLLEY_DATA, HOIST_DATA = AxisData.of(TROLLEY), AxisData.of(HOIST)


IDEAL = TROLLEY_DATA.with_(lag=0.0, brake_release=0.0, resolution=0.0)
