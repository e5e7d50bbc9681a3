"""Virtual devices: physics plus the program that a real device would run."""
