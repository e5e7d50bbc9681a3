"""A SINAMICS drive on standard telegram 1. No registers yet."""
