"""Gate, control token, interlocks: the one road from a person to the plant."""
