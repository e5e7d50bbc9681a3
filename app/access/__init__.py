"""People: users, roles, sessions, audit."""
