"""Gate, control token, interlocks: the one way from a person to the plant."""
