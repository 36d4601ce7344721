"""Settings of the server: environment variables RELUME_<NAME>."""

from __future__ import annotations

import os
import re
from ipaddress import ip_network
from pathlib import Path
from typing import Annotated, Literal

from platformdirs import user_data_dir
from pydantic import AfterValidator, Field, SecretStr, ValidationInfo, field_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from relume_worker.idle_timer import DEFAULT_IDLE_S

GIB = 1024**3
MIN_SECRET = 16
RoleName = Literal["view", "edit", "admin"]


def _default_cache_bytes() -> int:
    """A quarter of the memory of the machine or container in bytes, at most 6 GiB."""
    return min(_machine_bytes() // 4, 6 * GIB)


def _default_import_bytes() -> int:
    """Memory for one import if two run at once, in bytes, at most 8 GiB; the importer itself takes 1 GiB."""
    return max(GIB, min(_machine_bytes() // 3, 8 * GIB))


def _machine_bytes() -> int:
    from relume_worker.budget import machine_bytes  # imports many modules

    return machine_bytes()


def _editor_folder() -> Path:
    """The built editor: in a wheel beside this module, else of the checkout."""
    installed = Path(__file__).with_name("editor")
    return installed if installed.is_dir() else Path(__file__).resolve().parents[2] / "client_web" / "dist"


_HOST_NAME = re.compile(r"(?=.*[A-Za-z])[A-Za-z0-9_]([A-Za-z0-9_.-]{0,251}[A-Za-z0-9_])?")


def _check_host_or_network(text: str) -> str:
    try:
        ip_network(text, strict=False)
    except ValueError:
        if _HOST_NAME.fullmatch(text) is None:
            allowed = (
                "an address such as 10.0.0.5, a network such as 10.0.0.0/8, or a host name such as proxy.example.org"
            )
            raise ValueError(allowed) from None
    return text


HostOrNetwork = Annotated[str, AfterValidator(_check_host_or_network)]
"""An IP address, a network such as 10.0.0.0/8, or a host name."""


_SEGMENT = r"/(?!\.{1,2}(?:/|$))[A-Za-z0-9._~@:+=,%-]+"
_ROOT_PATH = re.compile(rf"(?!/(?:api|assets)/?$)(?:{_SEGMENT})+/?")
_MAX_ROOT_PATH = 255


def parse_root_path(text: str) -> str:
    """Prefix without a slash at its end; empty for "" and "/".

    `/api` and `/assets` alone are refused: with them, `/api/scenes` could be a path with or without prefix.

    Raises:
        ValueError: not a path of plain segments. `//host` would be another host in `Location`.
    """
    if text in ("", "/"):
        return ""
    if len(text) > _MAX_ROOT_PATH or _ROOT_PATH.fullmatch(text) is None:
        raise ValueError("a path such as /relume, of letters, digits and ._~@:+=,%- (not /api or /assets)")
    return text.removesuffix("/")


Config = Annotated[str | None, AfterValidator(lambda text: None if text == "none" else text)]
"""An OpenColorIO config, or "none"."""


class Settings(BaseSettings):
    """Settings of one server process; other RELUME_ variables are ignored."""

    model_config = SettingsConfigDict(env_prefix="RELUME_", env_ignore_empty=True, extra="ignore")

    data: Path = Field(default_factory=lambda: Path(user_data_dir("relume")), description="data directory")
    database: str = Field(default="", description="SQLAlchemy URL; empty: relume.db in the data directory")
    host: str = Field(default="127.0.0.1", description="address to listen on")
    port: int = Field(default=8420, ge=0, le=65535, description="port to listen on")
    root_path: Annotated[str, AfterValidator(parse_root_path)] = Field(
        default="", description="path at which a proxy publishes the server, such as /relume"
    )
    scheduler: str | None = Field(default=None, description="Dask scheduler, tcp://…; unset: an embedded worker")
    ocio: Config = Field(
        default_factory=lambda: os.environ.get("OCIO") or None,
        validate_default=True,
        description="OpenColorIO config: .ocio or .ocioz file, ocio://… for a built-in config, or none; unset: OCIO",
    )
    ocio_space: str | None = Field(default=None, description="the config's name of linear Rec. 709, if detection fails")
    client: Path = Field(default_factory=_editor_folder, description="directory of the built editor")
    cache_bytes: int = Field(
        default_factory=_default_cache_bytes, gt=0, description="budget of the cache of results computed from bakes"
    )
    cache_floor_bytes: int = Field(default=64 * 1024**2, ge=0, description="part of it for bakes that are not in use")
    batch_bytes: int = Field(
        default_factory=lambda: _default_cache_bytes() // 2,
        gt=0,
        description="cache of renders and comparisons, in all worker processes of a machine together",
    )
    prewarm: bool = Field(default=True, description="whether the first image of a new bake is computed in advance")
    max_queued: int = Field(default=100, ge=1, description="queued and running renders, and separately comparisons")
    max_queued_per_user: int | None = Field(
        default=None, ge=1, description="the same for one user; unset: a quarter if users log in"
    )
    idle_seconds: float = Field(
        default=DEFAULT_IDLE_S, ge=1, description="lifetime of unused bakes, scenes and processes"
    )
    max_upload_bytes: int = Field(default=2 * GIB, gt=0, description="largest upload, except measured materials")
    max_body_bytes: int = Field(default=16 * 1024**2, gt=0, description="largest request body for renders")
    min_free_bytes: int = Field(
        default=256 * 1024**2, ge=0, description="free disk space below which new work is refused"
    )
    max_sessions: int = Field(default=32, ge=1, description="live sessions at once")
    max_rooms: int = Field(default=32, ge=1, description="rooms at once")
    max_people: int = Field(default=8, ge=1, le=64, description="people in one room")
    reconnect_seconds: float = Field(default=60.0, gt=0, description="time to reconnect before a member leaves a room")
    import_seconds: int = Field(default=300, ge=1, description="time limit of a scene import")
    import_bytes: int = Field(
        default_factory=_default_import_bytes, gt=0, description="address space of a scene import"
    )
    preload_importer: bool = Field(
        default=True, description="whether the importer is loaded at startup instead of at the first import"
    )
    ack_seconds: float = Field(default=30.0, gt=0, description="time limit for acknowledging frames")
    resume_seconds: float = Field(default=600.0, gt=0, description="time in which a lost session can be resumed")
    login: bool = Field(
        default=False, description="whether users must log in; otherwise everyone who reaches the port is admin"
    )
    https_only: bool = Field(
        default=False, description="whether clients use HTTPS only: Secure cookies, Strict-Transport-Security"
    )
    trusted_proxies: list[HostOrNetwork] = Field(
        default=[], description="addresses, networks or names of proxies trusted for X-Forwarded-…, as JSON list"
    )
    user_header: str = Field(default="", description="header with the user's name from these proxies; empty: none")
    proxy_role: RoleName = Field(default="view", description="role of users named by a proxy")
    proxy_roles: dict[str, RoleName] = Field(default={}, description="roles of such users by name, as JSON object")
    allow_viewer_comments: bool = Field(default=False, description="whether the role view may write comments")
    fair_shares: dict[str, Annotated[float, Field(gt=0, le=1000)]] = Field(
        default={}, description="weights of users in fair scheduling, by name, as JSON object; 1 for all others"
    )
    max_sessions_per_user: int | None = Field(default=None, ge=1, description="live sessions of one user")
    max_bakes_per_user: int | None = Field(default=None, ge=1, description="queued and running bakes of one user")
    max_bytes_per_user: int | None = Field(default=None, ge=0, description="uploads and bakes of one user")
    requests_per_second: float | None = Field(
        default=None, gt=0, description="mean request rate of one user, or of one address without login"
    )
    requests_at_once: int = Field(default=200, ge=1, description="burst of requests of one user")
    audit_lines: int = Field(default=100_000, ge=1, description="changes in the audit; older ones are deleted")
    log_format: Literal["plain", "json"] = Field(default="plain", description="lines of the log: text, or JSON")
    log_level: Literal["debug", "info", "warning", "error"] = Field(
        default="warning", description="lowest level that is logged; info logs each request"
    )
    traces: bool = Field(
        default=False, description="whether spans of edits are sent to the collector of the OTEL_… variables"
    )
    drain_seconds: float = Field(default=10.0, ge=0, description="time for sessions to move after SIGTERM")
    stop_seconds: float = Field(default=30.0, gt=0, description="time for everything else to stop afterwards")
    webhook_hosts: list[HostOrNetwork] = Field(
        default=[],
        description="hosts that may get a message when a render ends, and networks such as 10.1.0.0/16 for addresses "
        "that are not public, as JSON list; empty: no webhooks",
    )
    webhook_secret: SecretStr = Field(
        default=SecretStr(""),
        validate_default=True,
        description=f"key of the signatures of these messages, at least {MIN_SECRET} characters",
    )
    allowed_origins: list[str] = Field(default=[], description="allowed origins besides the server's own, as JSON list")
    allowed_hosts: list[str] = Field(
        default=["localhost", "127.0.0.1", "::1"],
        description='host names of the server, as JSON list; ["*"] for any',
    )

    @field_validator("webhook_secret")
    @classmethod
    def _check_webhook_secret(cls, secret: SecretStr, info: ValidationInfo) -> SecretStr:
        if info.data.get("webhook_hosts") and len(secret.get_secret_value()) < MIN_SECRET:
            raise ValueError(f"at least {MIN_SECRET} characters, because RELUME_WEBHOOK_HOSTS is set")
        return secret

    @property
    def max_queued_per_client(self) -> int:
        """Queued and running jobs of a kind that one client may have; by default a quarter, which leaves room for three
        others.

        Without login all callers are one client, which may use the whole queue.
        """
        return self.max_queued_per_user or (max(1, self.max_queued // 4) if self.login else self.max_queued)

    @property
    def database_url(self) -> str:
        """SQLAlchemy URL of the database."""
        return self.database or f"sqlite:///{self.data / 'relume.db'}"
