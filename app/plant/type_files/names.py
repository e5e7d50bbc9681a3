"""Names that the files of a type give: of points, commands, alarms, options, arguments and everything else."""

KEY = r"[a-z][a-z0-9_]*"
KEY_EXPECTED = "a key of small letters, digits and _"
NAME_EXPECTED = "a name of small letters, digits and _"
ROLES = ("viewer", "operator", "engineer", "admin")
"""Who may be asked for."""
