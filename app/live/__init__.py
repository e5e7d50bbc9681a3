"""Who watches what, frames for browsers."""
