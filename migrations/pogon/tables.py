"""All tables of `pogon.db`: what its migrations are compared with, and what a new file is made of."""

import app.access.tables
import app.alarms.tables
import app.historian.notes
import app.historian.saved_views
import app.plant.retained
import app.running.classroom
import app.running.sequence_drafts  # noqa: F401
