"""Alembic's entry for `history.db`; url and tables come from app/db.py, or from `-x url=…` on the command line."""

import runpy
from pathlib import Path

from alembic import context

from app.db import history_tables, in_one

runpy.run_path(str(Path(__file__).with_name("tables.py")))
config = context.config
url = config.attributes.get("url") or context.get_x_argument(as_dictionary=True).get("url", "sqlite:///data/history.db")

with in_one(url) as connection:
    context.configure(connection=connection, target_metadata=history_tables, render_as_batch=True)
    with context.begin_transaction():
        context.run_migrations()
