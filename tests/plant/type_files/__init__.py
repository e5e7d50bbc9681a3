"""The readers of the files of an equipment type."""
