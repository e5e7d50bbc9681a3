"""Recorder, store, query, export."""
