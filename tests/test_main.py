"""The web application: every page's routes are in it, and the layers around it are those that the settings ask for."""

import pkgutil
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest
from fastapi import APIRouter, FastAPI
from starlette.middleware.gzip import GZipMiddleware

import app.web
from app.main import create_app
from app.settings import Settings
from app.web.guard import Gatekeeper


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> FastAPI:
    return create_app(Settings(data=tmp_path_factory.mktemp("main") / "data"))


def routers() -> Iterator[tuple[str, APIRouter]]:
    for found in pkgutil.walk_packages(app.web.__path__, "app.web."):
        router = getattr(import_module(found.name), "router", None)
        if isinstance(router, APIRouter) and router.routes:
            yield found.name, router


def test_every_route_of_a_module_of_the_web_is_in_the_application(made: FastAPI) -> None:
    served = {id(route) for route in made.router.routes}
    modules = dict(routers())
    assert len(modules) > 20
    missing = [name for name, router in modules.items() if not served.issuperset(id(route) for route in router.routes)]
    assert not missing


def test_no_address_is_served_twice(made: FastAPI) -> None:
    seen = [
        (route.path, method)  # type: ignore[attr-defined]
        for route in made.router.routes
        for method in sorted(getattr(route, "methods", None) or {"SOCKET"})
    ]
    assert len(seen) == len(set(seen))


def test_pages_about_the_interface_are_our_own(made: FastAPI) -> None:
    assert made.docs_url is made.redoc_url is made.openapi_url is None


@pytest.mark.parametrize(("behind", "layers"), [("", 4), ("172.30.80.1", 5)])
def test_addresses_of_a_proxy_are_believed_only_where_there_is_one(tmp_path: Path, behind: str, layers: int) -> None:
    made = create_app(Settings(data=tmp_path / "data", behind_proxy=behind))  # type: ignore[arg-type]
    classes = [layer.cls for layer in made.user_middleware]
    assert len(classes) == layers
    assert classes[-2:] == [GZipMiddleware, Gatekeeper], "what a person may see is packed, and asked for before"
