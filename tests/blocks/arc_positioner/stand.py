"""A lift on an arc, simulated."""

from app.blocks.arc_positioner.following import AxisLimits

X, Y = AxisLimits(660.4, 110.0, 220.0, 0.1), AxisLimits(132.08, 44.0, 88.0, 0.1)
