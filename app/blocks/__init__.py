"""Pure control blocks: numbers and dt in, numbers out."""
