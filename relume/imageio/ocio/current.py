"""The config of this process: one at most, read when it is first asked for."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from relume.errors import ParameterError
from relume.imageio.ocio.config import Config

_told: tuple[str, str | None] | None = None
_opened: Config | None = None


def use(source: str | None, working: str | None = None) -> None:
    """Use a config from now on, as `Config` takes it; None: none."""
    global _told, _opened
    _told, _opened = None if source is None else (source, working), None


@contextmanager
def using(source: str | None, working: str | None = None) -> Iterator[None]:
    """The same for as long as the block runs."""
    before = _told
    use(source, working)
    try:
        yield
    finally:
        use(*before or (None,))


def source() -> tuple[str, ...]:
    """What `use` was told, for another process that is to use the same; nothing where there is none."""
    return () if _told is None else tuple(part for part in _told if part is not None)


def current() -> Config | None:
    """The config in use; None where there is none. Raises ParameterError where it cannot be read."""
    global _opened
    if _told is not None and _opened is None:
        _opened = Config(*_told)
    return _opened


def needed() -> Config:
    """The config in use. Raises ParameterError where there is none."""
    config = current()
    if config is None:
        raise ParameterError("RELUME_OCIO", "not set", "an OpenColorIO config, which this needs")
    return config
