"""All tables of `history.db`: what its migrations are compared with, and what a new file is made of."""

import app.historian.tables  # noqa: F401
