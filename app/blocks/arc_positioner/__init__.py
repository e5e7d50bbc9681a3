"""Circular lift: trolley (X) and hoist (Y) on an arc; our path following, and the formulas of the original for comparison."""
