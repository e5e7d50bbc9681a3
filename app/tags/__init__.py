"""Batches, quality, the tag database."""
