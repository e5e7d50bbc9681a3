"""Equipment types: a folder each, of data; and of pure Python where their data cannot say what their records are."""
