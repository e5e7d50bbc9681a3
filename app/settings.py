"""What an installer may change: `POGON_…` variables, read once, passed by parameter."""

import ipaddress
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Self

from pydantic import Field, ValidationError, field_validator, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from app import bundled
from app.addresses import host_and_port, is_loopback
from app.errors import ConfigurationError

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

ROLES = frozenset({"viewer", "operator", "engineer", "admin"})
"""Those of people, which are known only further up (access/roles.py)."""
OTHERS = frozenset({"POGON_CHROMIUM", "POGON_SOAK_SECONDS"})
"""Variables of ours that are no settings of the server."""


class Settings(BaseSettings):
    """Defaults that work on a laptop; each field is a variable `POGON_<NAME>`."""

    model_config = SettingsConfigDict(env_prefix="POGON_", frozen=True, extra="forbid")

    host: str = Field("127.0.0.1", description="Address to listen on. Beyond loopback needs TLS or a proxy.")
    port: int = Field(8000, ge=0, le=65535, description="Port to listen on; 0 takes a free one.")
    data: Path = Field(Path("data"), description="Folder of databases, keys and the one-time code.")
    plant: Path = Field(bundled("plants/demo"), description="Folder of the plant (plant.toml).")
    tls_cert: Path | None = Field(
        None, description="PEM certificate chain; with POGON_TLS_KEY the server speaks https."
    )
    tls_key: Path | None = Field(None, description="PEM private key.")
    behind_proxy: str = Field(
        "", description="Addresses of TLS proxies whose X-Forwarded headers are trusted, comma separated."
    )
    allowed_hosts: str = Field(
        "", description="Host names that browsers may use, comma separated; empty: loopback names and POGON_HOST."
    )
    serve_modbus: str = Field("", description="HOST:PORT on which the simulated plant also answers Modbus TCP.")
    modbus_beyond: bool = Field(
        False,
        description="POGON_SERVE_MODBUS may listen beyond this machine: who reaches it writes past sign-in, interlocks and audit.",
    )
    dry_run: bool = Field(
        False, description="Commands are computed, shown and logged, but never written and never confirmed."
    )
    log_level: Literal["debug", "info", "warning", "error"] = Field("info", description="How much the log says.")
    log: Literal["text", "json"] = Field("text", description="Form of the log: lines, or an object of JSON a line.")
    syslog: str = Field(
        "", description="Where the log goes as well, RFC 5424: a socket such as /dev/log, or HOST:PORT of UDP."
    )
    notice: str = Field(
        "", max_length=1000, description="What everybody reads before signing in; empty: the product's own notice."
    )
    second_factor: str = Field(
        "",
        description="Roles that need a second factor (TOTP), comma separated, such as admin,engineer; empty: nobody must.",
    )
    audit_anchors: Path | None = Field(
        None, description="File on another disk or machine to which the anchors of the audit are added as well."
    )
    metrics_token: str = Field("", description="Token for /metrics from other machines; empty: loopback only.")
    history_keep_days: float = Field(400, gt=0, description="History older than this is cut [days].")
    history_quota_mb: float = Field(4096, ge=8, description="Size at which the oldest history is cut [MB].")
    export_rows: int = Field(1_000_000, ge=1, description="Most rows of one CSV export from a page.")
    push_period: float = Field(0.05, ge=0.02, le=1, description="Shortest time between two pushes to a browser [s].")

    @field_validator("serve_modbus")
    @classmethod
    def _is_address(cls, text: str) -> str:
        if text:
            try:
                host_and_port(text)
            except ConfigurationError as error:
                raise ValueError(str(error)) from error
        return text

    @field_validator("syslog")
    @classmethod
    def _is_syslog(cls, text: str) -> str:
        if text and not text.startswith("/"):
            try:
                host_and_port(text)
            except ConfigurationError as error:
                raise ValueError("expected a path such as /dev/log, or HOST:PORT such as 192.0.2.7:514") from error
        return text

    @field_validator("second_factor")
    @classmethod
    def _are_roles(cls, text: str) -> str:
        if unknown := sorted(_listed(text) - ROLES):
            raise ValueError(f"expected roles of {', '.join(sorted(ROLES))}, not {', '.join(unknown)}")
        return text

    @field_validator("behind_proxy")
    @classmethod
    def _are_proxies(cls, text: str) -> str:
        for address in (part.strip() for part in text.split(",")):
            try:
                if address:
                    ipaddress.ip_network(address)
            except ValueError as error:
                raise ValueError(f"expected IP addresses or networks, such as 172.30.80.1, not {address}") from error
        return text

    @model_validator(mode="after")
    def _safe_to_listen(self) -> Self:
        if bool(self.tls_cert) != bool(self.tls_key):
            raise ValueError("POGON_TLS_CERT and POGON_TLS_KEY go together: one of them is missing")
        if not is_loopback(self.host) and not self.tls_cert and not self.behind_proxy:
            raise ValueError(
                f"POGON_HOST={self.host} listens beyond this machine: set POGON_TLS_CERT and POGON_TLS_KEY, "
                "or POGON_BEHIND_PROXY to the addresses of the TLS proxy in front"
            )
        if self.serve_modbus and not self.modbus_beyond and not is_loopback(host_and_port(self.serve_modbus)[0]):
            raise ValueError(
                f"POGON_SERVE_MODBUS={self.serve_modbus} listens beyond this machine: expected 127.0.0.1, for whoever reaches "
                "it writes past sign-in, interlocks and audit; POGON_MODBUS_BEYOND=true allows that"
            )
        return self

    @property
    def factor_roles(self) -> frozenset[str]:
        """Roles that need a second factor."""
        return _listed(self.second_factor)

    @property
    def hosts(self) -> frozenset[str]:
        """Host names that a request may name, lower case, without port."""
        named = {name.strip().lower() for name in self.allowed_hosts.split(",") if name.strip()}
        own = set() if self.host in ("0.0.0.0", "::") else {self.host.lower()}
        return frozenset(named | own | {"localhost", "127.0.0.1", "[::1]", "::1"})


def _listed(text: str) -> frozenset[str]:
    return frozenset(part.strip().lower() for part in text.split(",") if part.strip())


def read_settings(**given: str) -> Settings:
    """The settings; `given` goes before the environment.

    Raises:
        ConfigurationError: one line per setting with its value and what was expected.
    """
    try:
        return Settings(**given)  # type: ignore[arg-type]
    except ValidationError as error:
        raise ConfigurationError("\n".join(map(_told, error.errors()))) from error


def _told(problem: "ErrorDetails") -> str:
    name = "".join(f"POGON_{str(part).upper()}={problem['input']}: " for part in problem["loc"])
    return name + problem["msg"].removeprefix("Value error, ")


def unknown_settings(environment: Iterable[str]) -> list[str]:
    """Names in `environment` that begin as ours do and are none of ours: mistyped, most likely."""
    known = {f"POGON_{name.upper()}" for name in Settings.model_fields} | OTHERS
    return sorted(name for name in environment if name.upper().startswith("POGON_") and name.upper() not in known)
