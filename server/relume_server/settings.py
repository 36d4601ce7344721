"""What an operator may set, each by an environment variable RELUME_<NAME>."""

from __future__ import annotations

import os
import re
from ipaddress import ip_network
from pathlib import Path
from typing import Annotated, Literal

from platformdirs import user_data_dir
from pydantic import AfterValidator, Field
from pydantic_settings import BaseSettings, SettingsConfigDict

from relume_worker.idle_timer import DEFAULT_IDLE_S

GIB = 1024**3
RoleName = Literal["view", "edit", "admin"]


def _default_cache_bytes() -> int:
    """A quarter of the memory of the machine or the container in bytes, at most 6 GiB."""
    return min(_machine_bytes() // 4, 6 * GIB)


def _default_import_bytes() -> int:
    """What one import may take where two run at once, at most 8 GiB; the program itself takes one."""
    return max(GIB, min(_machine_bytes() // 3, 8 * GIB))


def _machine_bytes() -> int:
    from relume_worker.budget import machine_bytes  # loads much that other settings do without

    return machine_bytes()


_HOST_NAME = re.compile(r"(?=.*[A-Za-z])[A-Za-z0-9_]([A-Za-z0-9_.-]{0,251}[A-Za-z0-9_])?")


def _check_proxy(text: str) -> str:
    try:
        ip_network(text, strict=False)
    except ValueError:
        if _HOST_NAME.fullmatch(text) is None:
            allowed = "an address such as 10.0.0.5, a network such as 10.0.0.0/8, or a host name such as proxy"
            raise ValueError(allowed) from None
    return text


ProxyAddress = Annotated[str, AfterValidator(_check_proxy)]
"""An IP address, a network as 10.0.0.0/8, or a name that is looked up."""


Config = Annotated[str | None, AfterValidator(lambda text: None if text == "none" else text)]
"""What OpenColorIO takes for a config, or "none"."""


class Settings(BaseSettings):
    """Settings of one server process; unknown RELUME_ variables are left to the other parts."""

    model_config = SettingsConfigDict(env_prefix="RELUME_", env_ignore_empty=True, extra="ignore")

    data: Path = Field(default_factory=lambda: Path(user_data_dir("relume")), description="data directory")
    database: str = Field(default="", description="SQLAlchemy URL; empty: relume.db in the data directory")
    host: str = Field(default="127.0.0.1", description="address to listen on")
    port: int = Field(default=8420, ge=0, le=65535, description="port to listen on")
    scheduler: str | None = Field(default=None, description="tcp://… of a Dask scheduler; unset: an embedded worker")
    ocio: Config = Field(
        default_factory=lambda: os.environ.get("OCIO") or None,
        validate_default=True,
        description="OpenColorIO config: .ocio or .ocioz file, ocio://… of a built-in one, or none; unset: OCIO",
    )
    ocio_space: str | None = Field(default=None, description="the config's name of linear Rec. 709, if it is not found")
    client: Path = Field(
        default=Path(__file__).resolve().parents[2] / "client_web" / "dist", description="the built editor"
    )
    cache_bytes: int = Field(
        default_factory=_default_cache_bytes, gt=0, description="budget of the cache of everything computed from bakes"
    )
    cache_floor_bytes: int = Field(default=64 * 1024**2, ge=0, description="of that, kept for bakes that nobody uses")
    batch_processes: int = Field(default=1, ge=1, le=64, description="processes for renders and comparisons")
    batch_bytes: int = Field(
        default_factory=lambda: _default_cache_bytes() // 2, gt=0, description="cache of each batch process"
    )
    batch_nice: int = Field(default=10, ge=0, le=19, description="nice(1) of batch processes")
    prewarm: bool = Field(
        default=True, description="whether the first image of a new bake is computed before anybody opens it"
    )
    max_queued: int = Field(default=100, ge=1, description="queued and running renders, and as many comparisons")
    max_queued_per_user: int | None = Field(
        default=None, ge=1, description="of these, of one user; unset: a quarter if users log in"
    )
    idle_seconds: float = Field(
        default=DEFAULT_IDLE_S, ge=1, description="how long unused bakes, scenes and processes are kept"
    )
    max_upload_bytes: int = Field(default=2 * GIB, gt=0, description="largest upload of a file but a measured material")
    max_body_bytes: int = Field(default=16 * 1024**2, gt=0, description="largest body of a call for renders")
    min_free_bytes: int = Field(
        default=256 * 1024**2, ge=0, description="free disk space below which new work is refused"
    )
    max_sessions: int = Field(default=32, ge=1, description="live sessions at once")
    max_rooms: int = Field(default=32, ge=1, description="rooms at once")
    max_people: int = Field(default=8, ge=1, le=64, description="people in one room")
    reconnect_seconds: float = Field(
        default=60.0, gt=0, description="how long a room keeps a member whose connection is lost"
    )
    import_seconds: int = Field(default=300, ge=1, description="time a scene import may take")
    import_bytes: int = Field(
        default_factory=_default_import_bytes, gt=0, description="address space a scene import may use"
    )
    preload_importer: bool = Field(
        default=True, description="whether the importer is loaded at start, not with the first import"
    )
    ack_seconds: float = Field(default=30.0, gt=0, description="how long a client may leave frames unacknowledged")
    resume_seconds: float = Field(default=600.0, gt=0, description="how long a lost session can be resumed")
    login: bool = Field(default=False, description="whether people log in; without it, whoever reaches the port is in")
    https_only: bool = Field(
        default=False, description="whether people reach it by https alone: Secure cookies, Strict-Transport-Security"
    )
    trusted_proxies: list[ProxyAddress] = Field(
        default=[], description="addresses, networks or names of proxies that say where a call comes from, as JSON list"
    )
    user_header: str = Field(default="", description="header in which they say who calls; empty: they say it of nobody")
    proxy_role: RoleName = Field(default="view", description="role of those whom a proxy names")
    proxy_roles: dict[str, RoleName] = Field(default={}, description="roles of some of them by name, as JSON object")
    allow_viewer_comments: bool = Field(default=False, description="whether the role view, too, may write comments")
    fair_shares: dict[str, Annotated[float, Field(gt=0, le=1000)]] = Field(
        default={}, description="weights of users in fair scheduling, by name, as JSON object; 1 for all others"
    )
    max_sessions_per_user: int | None = Field(default=None, ge=1, description="live sessions of one user")
    max_bakes_per_user: int | None = Field(default=None, ge=1, description="queued and running bakes of one user")
    max_bytes_per_user: int | None = Field(default=None, ge=0, description="uploads and bakes of one user")
    requests_per_second: float | None = Field(
        default=None, gt=0, description="calls of one user on the mean; of who is not known, of one address"
    )
    requests_at_once: int = Field(default=200, ge=1, description="burst of calls of one user")
    audit_lines: int = Field(default=100_000, ge=1, description="changes that the audit keeps")
    log_format: Literal["plain", "json"] = Field(default="plain", description="lines of the log: text, or JSON")
    log_level: Literal["debug", "info", "warning", "error"] = Field(
        default="warning", description="least level that is logged; info has a line for each request"
    )
    traces: bool = Field(default=False, description="whether spans of edits go to a collector, as OTEL_… variables say")
    drain_seconds: float = Field(default=10.0, ge=0, description="how long sessions may take to move after SIGTERM")
    stop_seconds: float = Field(default=30.0, gt=0, description="how long all else may take to stop after that")
    allowed_origins: list[str] = Field(default=[], description="origins besides the server's own, as JSON list")
    allowed_hosts: list[str] = Field(
        default=["localhost", "127.0.0.1", "::1"],
        description='names by which clients reach the server, as JSON list; ["*"] for any',
    )

    @property
    def max_queued_per_client(self) -> int:
        """How much work of a kind one client may have waiting: without a setting, what leaves room for three others.

        Where nobody logs in, all are one client, who may have all.
        """
        return self.max_queued_per_user or (max(1, self.max_queued // 4) if self.login else self.max_queued)

    @property
    def database_url(self) -> str:
        """The SQLAlchemy URL that is meant."""
        return self.database or f"sqlite:///{self.data / 'relume.db'}"
