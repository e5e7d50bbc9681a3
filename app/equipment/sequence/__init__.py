"""A sequence of the plant that a device runs step by step."""
