"""A failure as people read it."""

from __future__ import annotations

from typer.exceptions import TyperException


def sentence(error: Exception) -> str:
    """What went wrong, in one line."""
    from sqlalchemy.exc import DBAPIError

    from relume.errors import RelumeError
    from worker.database.faults import told

    if isinstance(error, TyperException):
        text = error.format_message() or "nothing to do; see relume --help"
    elif isinstance(error, RelumeError):
        text = str(error)
    elif isinstance(error, OSError) and error.strerror:
        text = f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    elif isinstance(error, DBAPIError):
        text = f"the database cannot be used ({told(error)}); see that it runs, and that RELUME_DATABASE names it"
    elif isinstance(error, MemoryError):
        text = "out of memory; take a smaller size or fewer lights"
    else:
        text = f"{type(error).__name__}: {str(error) or 'a defect'}; --verbose shows the trace"
    return " ".join(text.split())
