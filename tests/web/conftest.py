"""The application with a plant read from its files, without links: what the pages need of a running one."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from app import bundled
from app.clock import ManualClock
from app.main import dress
from app.plant.loader import read_plant
from app.plant.system import system_points
from app.plant.texts import Texts
from app.settings import Settings
from app.tags.database import Tag, TagDatabase

MakeApp = Callable[..., FastAPI]


def standing_runtime(settings: Settings) -> SimpleNamespace:
    """A runtime that stands still: plant, texts, tags without values."""
    plant, problems = read_plant(settings.plant)
    clock = ManualClock()
    tags = TagDatabase(clock)
    points = [*(plant.points.values() if plant else ()), *system_points(plant)]
    tags.configure(Tag(point.name, point.id, point.equipment) for point in points)
    return SimpleNamespace(
        settings=settings,
        clock=clock,
        plant=plant,
        problems=problems,
        tags=tags,
        texts=Texts.read(plant),
        simulated=plant is not None and all(link.simulated for link in plant.links.values()),
        links={},
        live=None,
    )


@pytest.fixture
def make_app() -> MakeApp:
    """`make_app(plant=folder, **settings)`: our pages, errors and headers around a runtime that stands still."""

    def make(plant: Path | None = None, **settings: Any) -> FastAPI:
        app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
        chosen = Settings(plant=plant or bundled("plants/demo"), **settings)
        app.state.runtime = standing_runtime(chosen)
        dress(app, chosen)
        return app

    return make


@pytest.fixture
def client(make_app: MakeApp) -> TestClient:
    """A browser without cookies at the demo plant."""
    return browse(make_app())


def browse(app: FastAPI, **options: Any) -> TestClient:
    """A client that names a host of ours and does not follow redirects by itself."""
    return TestClient(app, base_url="http://127.0.0.1:8000", follow_redirects=False, **options)
