"""The parts of plant.toml: one reader for each; plant/loader.py has them read in order."""
