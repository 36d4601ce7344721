"""Number of queued and running jobs by kind."""

from __future__ import annotations

from collections.abc import Mapping

from sqlalchemy import func, select
from sqlalchemy.orm import Session, sessionmaker

from relume_server.persistence.tables import BtfRow, ComparisonRow, JobRow, RenderRow
from relume_worker.database.models import BakeRow

_ROWS: Mapping[str, type[BakeRow] | type[JobRow]] = {
    "bake": BakeRow,
    "render": RenderRow,
    "comparison": ComparisonRow,
    "btf": BtfRow,
}
_STATES = ("queued", "running")


def count_jobs(sessions: sessionmaker[Session]) -> Mapping[tuple[str, str], int]:
    """Count rows by kind and state, "queued" or "running"."""
    counts = {(kind, state): 0 for kind in _ROWS for state in _STATES}
    with sessions() as session:
        for kind, row in _ROWS.items():
            query = select(row.state, func.count()).where(row.state.in_(_STATES)).group_by(row.state)
            counts.update({(kind, state): count for state, count in session.execute(query)})
    return counts
