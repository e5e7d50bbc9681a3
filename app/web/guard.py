"""What each route asks of a person. A route that says nothing is a mistake, found when the server starts."""

from collections.abc import Iterable

from fastapi import Depends, FastAPI
from fastapi.params import Depends as Dependency
from fastapi.routing import iter_route_contexts
from starlette.requests import HTTPConnection

from app.errors import ConfigurationError

PERMISSIONS = {
    "open": "nothing: health, static files, signing in",
    "view": "see screens of levels 1 to 3 and live values",
}
"""Permission → what it allows. A route names one of these."""


class Allow:
    """The dependency that a route declares: who lacks `permission` does not get in."""

    def __init__(self, permission: str) -> None:
        if permission not in PERMISSIONS:
            raise ConfigurationError(f'permission "{permission}" is unknown: expected one of {", ".join(PERMISSIONS)}')
        self.permission = permission

    def __call__(self, connection: HTTPConnection) -> None:
        """Note what is asked for; app/access decides about it."""
        connection.state.permission = self.permission


def allow(permission: str) -> Dependency:
    """For a route: `dependencies=[allow("view")]`.

    Raises:
        ConfigurationError: the permission is not one of `PERMISSIONS`.
    """
    dependency: Dependency = Depends(Allow(permission))
    return dependency


def permissions(app: FastAPI) -> dict[str, str]:
    """Route (`GET /equipment/{id}`) → permission, for every route of `app`; empty where none is declared."""
    table: dict[str, str] = {}
    for route in iter_route_contexts(app.routes):
        original = getattr(route, "starlette_route", None) or route.original_route
        declared: Iterable[Dependency] = [
            *(getattr(route, "dependencies", None) or ()),
            *(getattr(original, "dependencies", None) or ()),
        ]
        asked = [item.dependency.permission for item in declared if isinstance(item.dependency, Allow)]
        path = getattr(route, "path", None) or getattr(original, "path", "")
        methods = getattr(route, "methods", None) or getattr(original, "methods", None) or {"LIVE"}
        for method in sorted(methods):
            table[f"{method} {path}"] = asked[0] if asked else ""
    return table


def check_declared(app: FastAPI) -> None:
    """Refuse to serve a route for which nobody said who may use it.

    Raises:
        ConfigurationError: names every such route.
    """
    silent = [route for route, permission in permissions(app).items() if not permission]
    if silent:
        raise ConfigurationError(
            f"{', '.join(silent)}: no permission declared, expected dependencies=[allow(…)] with one of {', '.join(PERMISSIONS)}"
        )
