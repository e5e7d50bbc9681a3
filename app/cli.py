"""The command line: pogon run, simulate, check, probe, export, user, audit, backup, restore."""

from typing import Annotated

import typer
import uvicorn
from pydantic import ValidationError

from app import __version__
from app.main import create_app
from app.settings import Settings

cli = typer.Typer(name="pogon", no_args_is_help=True, help=__doc__)


def main() -> None:
    """Entry point of the console script."""
    cli()


def _say_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"pogon {__version__}")
        raise typer.Exit


@cli.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_say_version, help="Print the version and stop.")
    ] = False,
) -> None:
    """Pogon: an open web HMI/SCADA."""


@cli.command()
def run() -> None:
    """Start the plant and its web server (settings are POGON_ variables, see README)."""
    settings = read_settings()
    uvicorn.run(
        create_app(settings),
        host=settings.host,
        port=settings.port,
        log_level=settings.log_level,
        timeout_graceful_shutdown=2,
        server_header=False,
        ws_max_size=65536,
    )


def read_settings() -> Settings:
    """The settings, or one line per mistake and exit code 2."""
    try:
        return Settings()
    except ValidationError as error:
        for problem in error.errors():
            name = "".join(f"POGON_{str(part).upper()}={problem.get('input')}: " for part in problem["loc"])
            typer.echo(f"pogon: {name}{problem['msg'].removeprefix('Value error, ')}", err=True)
        raise typer.Exit(2) from error


if __name__ == "__main__":
    main()
