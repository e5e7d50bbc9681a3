"""One reader for each kind of file in the folder of an equipment type; plant/types.py has them read in order."""
