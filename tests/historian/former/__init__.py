"""What a version before the records stored, and what it exported of that: a database, further events, and its CSV files."""
