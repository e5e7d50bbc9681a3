"""Who may do what, and what they did: people, roles, sessions, tokens, audit."""
