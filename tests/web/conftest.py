"""A running Pogon in this process: the demo plant or another, with people and audit in a folder of its own."""

import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from app import bundled
from app.settings import Settings
from tests.virtual import HOST, MORNING, house

Start = Callable[..., TestClient]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """`start(plant=folder, extend=add_routes, **settings)`: a running application, and a browser at it."""
    with ExitStack() as running:

        def begin(
            plant: Path | None = None,
            extend: Callable[[FastAPI], object] = lambda app: None,
            **settings: Any,
        ) -> TestClient:
            return running.enter_context(_running(tmp_path / "data", plant, extend, **settings))

        yield begin


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Iterator[TestClient]:
    """One running demo plant for all tests of a module; a module says in BEGUN when it began, if that matters."""
    settings = Settings(data=tmp_path_factory.mktemp("demo") / "data")
    with house(settings, begin=getattr(request.module, "BEGUN", MORNING)) as browser:
        yield browser


@pytest.fixture
def client(demo: TestClient) -> TestClient:
    """A browser at the demo plant, without cookies, that follows no redirect by itself."""
    demo.cookies.clear()
    return demo


def send(client: TestClient, path: str, data: dict[str, str], **headers: str) -> Any:
    """Post a form as a page of ours does: with its token and from its origin."""
    token = re.search(r'name="csrf" value="([^"]*)"', client.get("/").text)
    assert token
    return client.post(path, data={"csrf": token[1], **data}, headers={"Origin": HOST, **headers})


def _running(
    data: Path, plant: Path | None = None, extend: Callable[[FastAPI], object] = lambda app: None, **settings: Any
) -> TestClient:
    return house(Settings(plant=plant or bundled("plants/demo"), data=data, **settings), extend=extend)
