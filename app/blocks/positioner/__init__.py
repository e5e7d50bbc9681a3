"""Point-to-point positioning of one axis: ours, and the formulas of the original for comparison."""
