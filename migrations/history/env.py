"""Alembic's entry for `history.db`; url and tables come from app/db.py, or from `-x url=…` on the command line."""

from alembic import context
from sqlalchemy import create_engine

import app.historian.tables  # noqa: F401
from app.db import history_tables

config = context.config
url = config.attributes.get("url") or context.get_x_argument(as_dictionary=True).get("url", "sqlite:///data/history.db")

with create_engine(url).connect() as connection:
    context.configure(connection=connection, target_metadata=history_tables, render_as_batch=True)
    with context.begin_transaction():
        context.run_migrations()
