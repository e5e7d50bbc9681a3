"""Data of the ladle crane."""
