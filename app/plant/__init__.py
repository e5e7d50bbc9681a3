"""A plant folder becomes (definitions, problems)."""
