"""The ladle crane's mechanics: axes with drives and brakes, ropes, sway; and the figures they are made of. No registers yet."""
