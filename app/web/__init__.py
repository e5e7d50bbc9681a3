"""Routes and the socket: ask the runtime, render a template; no rules here."""
