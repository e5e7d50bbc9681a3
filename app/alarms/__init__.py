"""Conditions, life cycle (pure), engine, journal."""
