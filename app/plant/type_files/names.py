"""Names that the files of a type give: of points, commands, alarms, options, arguments and everything else."""

from app.plant.said import said

KEY = r"[a-z][a-z0-9_]*"
KEY_EXPECTED = said("mistake.key")
NAME_EXPECTED = said("mistake.name")
NUMBER_EXPECTED = said("mistake.number_or_expression")
ROLES = ("viewer", "operator", "engineer", "admin")
"""Who may be asked for."""
