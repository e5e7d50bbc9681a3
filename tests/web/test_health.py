"""Health, readiness, metrics."""

import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app.settings import Settings
from tests.virtual import house, until


@pytest.fixture
def client(tmp_path: Path) -> Iterator[TestClient]:
    settings = Settings(data=tmp_path / "data", metrics_token="a-long-token")
    with house(settings) as client:
        yield client


def test_healthy_while_all_tasks_run_and_ill_when_one_is_down(client: TestClient) -> None:
    assert client.get("/healthz").json()["status"] == "ok"
    supervisor = client.app.state.runtime.supervisor  # type: ignore[attr-defined]
    supervisor.tasks["live"].alive = False
    answer = client.get("/healthz")
    assert answer.status_code == 503
    assert answer.json()["tasks_down"] == ["live"]


@pytest.mark.sweep(8)
def test_a_late_loop_is_not_healthy(client: TestClient) -> None:
    client.app.state.runtime.sweep.__class__.loop_lag = property(lambda self: 1.5, lambda self, value: None)  # type: ignore[attr-defined]
    try:
        assert client.get("/healthz").status_code == 503
    finally:
        del client.app.state.runtime.sweep.__class__.loop_lag  # type: ignore[attr-defined]


def test_a_pulled_cable_is_not_ready_but_healthy(tmp_path: Path, free_port: int) -> None:
    demo = Path("plants/demo/plant.toml").read_text("utf-8")
    shutil.copytree("plants/demo", tmp_path, dirs_exist_ok=True)
    (tmp_path / "plant.toml").write_text(
        demo.replace('transport = "memory"', f'transport = "tcp"\nhost = "127.0.0.1"\nport = {free_port}'), "utf-8"
    )
    settings = Settings(data=tmp_path / "data", plant=tmp_path)
    with house(settings) as client:
        answer = client.get("/readyz")
        assert answer.status_code == 503
        assert answer.json() == {
            "status": "not ready",
            "plant": True,
            "links_down": sorted(tomllib.loads(demo)["links"]),
        }
        assert client.get("/healthz").status_code == 200


def test_ready_when_every_device_answers_and_not_with_a_broken_plant(client: TestClient, tmp_path: Path) -> None:
    assert until(lambda: client.get("/readyz").status_code == 200, 60)
    settings = Settings(data=tmp_path / "other", plant=tmp_path / "none")
    with house(settings) as broken:
        assert broken.get("/readyz").json() == {"status": "not ready", "plant": False, "links_down": []}
        assert broken.get("/healthz").status_code == 200


def test_metrics_are_for_this_machine_or_a_token(tmp_path: Path) -> None:
    settings = Settings(data=tmp_path / "data", metrics_token="a-long-token")
    with house(settings, client=("192.0.2.7", 5)) as stranger:
        assert stranger.get("/metrics").status_code == 403
        assert stranger.get("/metrics", headers={"Authorization": "Bearer wrong"}).status_code == 403
        answer = stranger.get("/metrics", headers={"Authorization": "Bearer a-long-token"})
        assert answer.status_code == 200
        assert 'pogon_link_up{link="hall"}' in answer.text
        assert "pogon_loop_lag_seconds" in answer.text
