"""Virtual devices of types that describe the machine behind their registers as data (`simulation.toml`, plant/type_files/simulation.py).

There is no `build` here: which type has one is in its data (sim/machines.py).
"""
