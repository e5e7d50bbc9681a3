"""The web application; its lifespan starts and stops the plant."""

from fastapi import FastAPI

from app import __version__
from app.settings import Settings


def create_app(settings: Settings) -> FastAPI:
    """The application for `settings`, ready to be served."""
    app = FastAPI(title="Pogon", version=__version__, docs_url=None, redoc_url=None, openapi_url=None)

    @app.get("/healthz")
    async def healthz() -> dict[str, str]:
        return {"status": "ok"}

    @app.get("/readyz")
    async def readyz() -> dict[str, str]:
        return {"status": "ok"}

    return app
