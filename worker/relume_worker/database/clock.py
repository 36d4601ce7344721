"""The database's clock, on which leases depend: processes on several machines share it."""

from __future__ import annotations

from typing import Any

from sqlalchemy import Double
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.functions import FunctionElement


class epoch_s(FunctionElement[float]):  # noqa: N801  used as a function
    """Seconds since 1970 when the statement runs."""

    name = "epoch_s"
    inherit_cache = True
    type = Double()


@compiles(epoch_s, "sqlite")
def _compile_sqlite(element: epoch_s, compiler: Any, **_: object) -> str:
    return "((julianday('now') - 2440587.5) * 86400.0)"


@compiles(epoch_s, "postgresql")
def _compile_postgresql(element: epoch_s, compiler: Any, **_: object) -> str:
    return "extract(epoch from clock_timestamp())::float8"
