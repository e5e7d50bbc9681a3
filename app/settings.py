"""What an installer may change: `POGON_…` variables, read once, passed by parameter."""

import errno
import ipaddress
import os
import stat
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

from pydantic import Field, ValidationError, field_validator, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from app import bundled
from app.addresses import host_and_port, is_loopback, names_host
from app.errors import ConfigurationError

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

ROLES = frozenset({"viewer", "operator", "engineer", "admin"})
"""Those of people, which are known only further up (access/roles.py)."""
LONGEST_PATH, LONGEST_NAME = 4095, 255
"""Of a path, and of one folder or file in it [bytes]."""
SHOWN = 120
"""Of a value in a message [signs]."""
SECRETS = frozenset({"metrics_token"})
"""Whose values no message repeats."""
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
    published_port: int = Field(
        0,
        ge=0,
        le=65535,
        description="Port at which others reach it where that is not its own, as in a container; 0: its own.",
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
    history_keep_days: float = Field(400, gt=0, le=36_500, description="History older than this is cut [days].")
    history_quota_mb: float = Field(4096, ge=8, le=1e9, description="Size at which the oldest history is cut [MB].")
    export_rows: int = Field(1_000_000, ge=1, le=1_000_000_000, description="Most rows of one CSV export from a page.")
    push_period: float = Field(0.05, ge=0.02, le=1, description="Shortest time between two pushes to a browser [s].")

    @field_validator("data", "plant", "tls_cert", "tls_key", "audit_anchors", mode="before")
    @classmethod
    def _is_path(cls, given: Any) -> Any:
        text = os.fspath(given) if isinstance(given, str | os.PathLike) else "x"
        names = [len(os.fsencode(name)) for name in text.split("/")]
        if not text.strip() or any(ord(sign) < 32 for sign in text):
            raise ValueError("expected a path")
        if len(os.fsencode(text)) > LONGEST_PATH or max(names) > LONGEST_NAME:
            raise ValueError(f"expected a path of at most {LONGEST_PATH} bytes, {LONGEST_NAME} in each of its names")
        return given

    @field_validator("tls_cert", "tls_key", "audit_anchors", mode="before")
    @classmethod
    def _may_be_unset(cls, given: Any) -> Any:
        # before `_is_path`: pydantic begins with the last
        return None if given == "" else given

    @field_validator("host")
    @classmethod
    def _is_host(cls, text: str) -> str:
        if not names_host(text):
            raise ValueError("expected an address or name of this machine without port, such as 127.0.0.1 or localhost")
        return text

    @field_validator("allowed_hosts")
    @classmethod
    def _are_hosts(cls, text: str) -> str:
        for name in _parts(text):
            if not names_host(name.removeprefix("[").removesuffix("]")):
                raise ValueError(
                    "expected host names as browsers send them, such as pogon.plant.example, without http://, port or path, "
                    f"not {shown(name)}"
                )
        return text

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
                host, port = host_and_port(text)
            except ConfigurationError:
                host, port = "", 0
            if not port or not names_host(host):
                raise ValueError("expected a path such as /dev/log, or HOST:PORT such as 192.0.2.7:514")
        return text

    @field_validator("second_factor")
    @classmethod
    def _are_roles(cls, text: str) -> str:
        unknown = sorted(_listed(text) - ROLES)
        if unknown or (text and not _listed(text)):
            said = f", not {shown(', '.join(unknown))}" if unknown else ""
            raise ValueError(f"expected roles of {', '.join(sorted(ROLES))}{said}")
        return text

    @field_validator("behind_proxy")
    @classmethod
    def _are_proxies(cls, text: str) -> str:
        for address in _parts(text):
            try:
                network = ipaddress.ip_network(address)
            except ValueError as error:
                raise ValueError(
                    f"expected IP addresses or networks, such as 172.30.80.1, not {shown(address)}"
                ) from error
            if not network.prefixlen:
                raise ValueError(
                    f"expected addresses of the TLS proxies, such as 172.30.80.1, not everybody ({address})"
                )
        if text and not _parts(text):
            raise ValueError("expected IP addresses or networks, such as 172.30.80.1")
        return text

    @field_validator("metrics_token")
    @classmethod
    def _is_token(cls, text: str) -> str:
        if not all("!" <= sign <= "~" for sign in text):
            raise ValueError(
                "expected letters, digits and signs of ASCII without spaces: others do not fit into a header"
            )
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
        named = {name.lower() for name in _parts(self.allowed_hosts)}
        own = set() if self.host in ("0.0.0.0", "::") else {self.host.lower()}
        return frozenset(named | own | {"localhost", "127.0.0.1", "[::1]", "::1"})


def _listed(text: str) -> frozenset[str]:
    return frozenset(part.lower() for part in _parts(text))


def _parts(text: str) -> list[str]:
    return [part.strip() for part in text.split(",") if part.strip()]


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
    named = [str(part) for part in problem["loc"]]
    said = "".join(
        f"POGON_{name.upper()}{'' if name in SECRETS else '=' + shown(str(problem['input']))}: " for name in named
    )
    return said + problem["msg"].removeprefix("Value error, ")


def shown(text: str) -> str:
    """`text` as a message repeats it: on one line, and cut when it is very long."""
    line = "".join(sign if sign.isprintable() else f"\\x{ord(sign):02x}" for sign in text[:SHOWN])
    return line if len(text) <= SHOWN else f"{line}… ({len(text)} characters)"


def check_places(settings: Settings) -> list[str]:
    """Refuse settings that name a folder, file or socket that is something else, before anything is started. Nothing is opened or made.

    A data folder that is not there is made by the start; what is wrong in a plant folder is listed on a page of the running server. Where
    copies go to (anchors, syslog) may come later, as no plant waits for that: what is not there is returned, to be told.

    Raises:
        ConfigurationError: one line per setting with its value and what was expected.
    """
    anchors, absent = settings.audit_anchors, os.strerror(errno.ENOENT)
    wrong = [
        ("DATA", settings.data, "a folder", _other_than(settings.data, stat.S_ISDIR, missing=True)),
        ("PLANT", settings.plant, "a folder with plant.toml", _other_than(settings.plant, stat.S_ISDIR)),
    ]
    later = []
    if anchors is not None:
        why = _other_than(anchors.parent, stat.S_ISDIR) or _other_than(anchors, stat.S_ISREG, missing=True)
        if not why and not os.access(anchors if anchors.exists() else anchors.parent, os.W_OK):
            why = os.strerror(errno.EACCES)
        later.append(("AUDIT_ANCHORS", anchors, "a file that may be written, in a folder that is there", why))
    if settings.syslog.startswith("/"):
        place = Path(settings.syslog)
        later.append(
            ("SYSLOG", place, "the socket of a running syslog such as /dev/log", _other_than(place, stat.S_ISSOCK))
        )
    found = [(_line(*one), one in later and one[3] == absent) for one in (*wrong, *later) if one[3]]
    if not all(may_come for _, may_come in found):
        raise ConfigurationError("\n".join(line for line, _ in found))
    return [f"{line}: nothing goes there until it is" for line, _ in found]


def _line(name: str, path: Path, expected: str, why: str) -> str:
    return f"POGON_{name}={shown(str(path))}: expected {expected} ({why})"


def _other_than(path: Path, kind: Callable[[int], bool], *, missing: bool = False) -> str:
    """Why `path` is not of this `kind`; empty when it is, or is not there and may be `missing`."""
    try:
        return "" if kind(path.stat().st_mode) else "it is something else"
    except FileNotFoundError as error:
        return "" if missing and not path.is_symlink() else error.strerror or str(error)
    except OSError as error:
        return error.strerror or str(error)


def unknown_settings(environment: Iterable[str]) -> list[str]:
    """Names in `environment` that begin as ours do and are none of ours: mistyped, most likely."""
    known = {f"POGON_{name.upper()}" for name in Settings.model_fields} | OTHERS
    return sorted(name for name in environment if name.upper().startswith("POGON_") and name.upper() not in known)
