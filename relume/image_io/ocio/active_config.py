"""The OpenColorIO config of this process: at most one, read on first use."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from relume.core.errors import Description, ParameterError
from relume.image_io.ocio.config import Config

_requested: tuple[str, str | None] | None = None
_active_config: Config | None = None


def use_config(source: str | None, working: str | None = None) -> None:
    """Use a config from now on, with the arguments of `Config`; None: no config."""
    global _requested, _active_config
    _requested, _active_config = None if source is None else (source, working), None


@contextmanager
def using_config(source: str | None, working: str | None = None) -> Iterator[None]:
    """Context in which another config is used."""
    previous = _requested
    use_config(source, working)
    try:
        yield
    finally:
        use_config(*previous or (None,))


def config_source() -> tuple[str, ...]:
    """Arguments of `use_config`, for another process that should use the same config; empty without a config."""
    return () if _requested is None else tuple(value for value in _requested if value is not None)


def get_config() -> Config | None:
    """The active config; None if there is none. Raises ParameterError if it cannot be read."""
    global _active_config
    if _requested is not None and _active_config is None:
        _active_config = Config(*_requested)
    return _active_config


def require_config() -> Config:
    """The active config. Raises ParameterError if there is none."""
    config = get_config()
    if config is None:
        raise ParameterError("RELUME_OCIO", Description("not set"), "an OpenColorIO config, which this needs")
    return config
