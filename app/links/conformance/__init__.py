"""Which rules of the register map the server of a PLC keeps: `examination.examine` asks it, the other modules hold the rules.

The rules are those of docs/registers/<type>.md. Nothing is written unless the caller says so, and then only what moves nothing.
"""
