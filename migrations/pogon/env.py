"""Alembic's entry for `pogon.db`; url and tables come from app/db.py, or from `-x url=…` on the command line."""

from alembic import context
from sqlalchemy import create_engine

import app.access.tables
import app.alarms.tables
import app.plant.retained  # noqa: F401
from app.db import pogon_tables

config = context.config
url = config.attributes.get("url") or context.get_x_argument(as_dictionary=True).get("url", "sqlite:///data/pogon.db")

with create_engine(url).connect() as connection:
    context.configure(connection=connection, target_metadata=pogon_tables, render_as_batch=True)
    with context.begin_transaction():
        context.run_migrations()
