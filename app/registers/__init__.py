"""Words ↔ values."""
