"""All errors that relume raises on purpose. Messages end with a remedy."""

from __future__ import annotations

import errno


def bytes_text(num_bytes: float) -> str:
    """Format a number of bytes for users, with two or three digits: 34 kB, 1.2 GB."""
    size, unit = float(num_bytes), "bytes"
    for larger in ("kB", "MB", "GB", "TB"):
        if abs(size) < 999.5:
            break
        size, unit = size / 1000, larger
    return f"{size:.0f} {unit}" if unit == "bytes" or size >= 99.5 else f"{size:.2g} {unit}"


def count_text(count: int, singular: str, plural: str) -> str:
    """Format a count with its noun, `singular` or `plural`: 1 entry, 2 entries."""
    return f"{count:,} {singular if count == 1 else plural}"


class RelumeError(Exception):
    """Base class of all relume errors; any other exception that escapes is a defect."""


class NotFoundError(RelumeError):
    """No object has that name."""


class SceneError(RelumeError, ValueError):
    """A scene or environment file cannot be used as it is."""


class MaterialError(RelumeError, ValueError):
    """A measured material cannot be used as it is."""


class Description(str):
    """Words that stand for a value in a message, without quotation marks: "a list of 3 looks"."""

    __slots__ = ()


class ParameterError(RelumeError, ValueError):
    """A value is not allowed for its parameter.

    Attributes:
        name: JSON pointer or name of the parameter.
        value: the given value, or a `Description` of it.
        allowed: the accepted values, in words.
    """

    def __init__(self, name: str, value: object, allowed: str) -> None:
        text = "missing" if value is None else value if isinstance(value, Description) else repr(value)
        if len(text) > 80:
            text = text[:77] + "..."
        super().__init__(f"{name} is {text}; give {allowed}")
        self.name, self.value, self.allowed = name, value, allowed


class ShapeMismatchError(RelumeError, ValueError):
    """Two arrays that belong together have incompatible shapes."""


class PlanError(RelumeError):
    """A bake or render cannot be planned as asked."""


class BudgetError(PlanError):
    """A plan needs more than the budget allows; raised before anything is computed."""

    def __init__(self, label: str, needed_bytes: int, allowed_bytes: int, remedy: str) -> None:
        needed, allowed = bytes_text(needed_bytes), bytes_text(allowed_bytes)
        super().__init__(f"{label} needs {needed}, and may take at most {allowed}; {remedy}")
        self.needed_bytes, self.allowed_bytes = needed_bytes, allowed_bytes


class MemoryBudgetError(BudgetError):
    """A plan needs more memory than allowed."""


class DiskBudgetError(BudgetError):
    """A plan needs more disk space than allowed."""


class ResultUnavailableError(RelumeError):
    """An optional result could not be computed; the displayed image stays."""


class StoreError(RelumeError):
    """A transfer store cannot be read or written."""


class StoreNotFoundError(StoreError, FileNotFoundError):
    """There is no store where one was expected."""


class SchemaVersionError(StoreError):
    """A store was written by a version of relume whose layout differs."""

    def __init__(self, stored: int, current: int) -> None:
        super().__init__(f"the store has schema version {stored}, this relume reads {current}; bake the scene again")
        self.stored, self.current = stored, current


class StoreDeletedError(StoreNotFoundError):
    """A store was deleted while it was open."""

    def __init__(self) -> None:
        super().__init__(
            "the bake was deleted while it was open; bake the scene again, and import the scene again if it was deleted"
        )


class ChunkDamagedError(StoreError):
    """A chunk of a store is missing or fails its checksum."""

    def __init__(self, path: str, detail: str) -> None:
        super().__init__(f"{path} is damaged ({detail}); delete the bake and bake again")
        self.path = path


class DiskFullError(RelumeError):
    """A file cannot be written because the disk is full."""

    def __init__(self, label: str) -> None:
        super().__init__(f"{label} cannot be written, the disk is full; free some space, then try again")


def is_disk_full(error: OSError) -> bool:
    """True if a disk or a disk quota is full."""
    return error.errno in (errno.ENOSPC, errno.EDQUOT)


class DatabaseDamagedError(RelumeError):
    """The database file is damaged or not a database."""

    def __init__(self, detail: str) -> None:
        super().__init__(
            f"the database is damaged ({detail}); stop relume and put a backup of relume.db in its place, or move"
            " relume.db, relume.db-wal and relume.db-shm away: lists of scenes, bakes and looks then start empty, their"
            " files stay"
        )
        self.detail = detail


class LedgerVersionError(RelumeError):
    """The database has a schema that this relume cannot use, or may not migrate by itself."""


class BackupError(RelumeError):
    """A backup cannot be made, read or restored as asked."""


class StorageError(RelumeError):
    """The object storage does not answer, refuses a request, or holds damaged data."""


class EditError(RelumeError):
    """An edit cannot be applied; the look stays as it was."""


class NotPrecomputedError(ResultUnavailableError):
    """An operation needs a curve that is not precomputed yet."""


class EditNotSupportedError(EditError):
    """The transfer method of this bake does not support such an edit."""

    def __init__(self, method: str, kind: str) -> None:
        super().__init__(f"a bake of method {method!r} does not support an edit of {kind}; bake again for it")
        self.method, self.kind = method, kind


class ProtocolError(RelumeError):
    """A client violated the session protocol; carries the WebSocket close code."""

    def __init__(self, message: str, close_code: int) -> None:
        super().__init__(message)
        self.close_code = close_code


class VersionMismatchError(ProtocolError):
    """Client and server speak different versions of the session protocol."""


class CancelledError(RelumeError):
    """Work was stopped on request."""
