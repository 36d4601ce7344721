"""Renders, comparisons and BTF jobs in the database of a data directory. A server runs them, and may run now."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from relume_cli.database.actions import OpenFolder
    from relume_server.auth.quotas import OwnedKind
    from relume_worker.database.models import JobRow


class JobTable(NamedTuple):
    """A kind of jobs.

    Attributes:
        name: kind in the database. folder: of the files, in the data directory. owned: kind in quotas.
        placeholder: of requests that cannot be read. fields: fields of a request that documents have.
        total: number of steps of a request. unit: of steps. title: title of a request, in lines.
    """

    name: str
    folder: str
    owned: OwnedKind
    placeholder: Any
    fields: tuple[str, ...]
    total: Callable[[Any], int]
    unit: str
    title: Callable[[Any], str]


def job_tables() -> Mapping[str, JobTable]:
    """Tables by the noun of commands."""
    from relume_server.jobs.btf_jobs import BtfJobs
    from relume_server.jobs.comparison_jobs import ComparisonJobs
    from relume_server.schemas.renders import RENDER_PLACEHOLDER

    return {
        "render": JobTable(
            "render", "renders", "render", RENDER_PLACEHOLDER, ("bake", "view", "format", "size"),
            lambda request: int(request.num_images), "frames",
            lambda request: f"{request.name or request.view or 'render'}, {request.format}",
        ),
        "comparison": JobTable(
            "comparison", "comparisons", "comparison", ComparisonJobs.placeholder, ("bake", "view", "paths"),
            lambda request: int(request.passes), "passes", lambda request: f"{request.view} of bake {request.bake}",
        ),
        "btf-job": JobTable(
            "btf", "btf-jobs", "btf-job", BtfJobs.placeholder, ("name", "geometry"),
            lambda request: 1, "steps", lambda request: str(request.name),
        ),
    }  # fmt: skip


def job_rows(data_folder: OpenFolder, table: JobTable) -> list[JobRow]:
    """Jobs of a kind, newest first."""
    from sqlalchemy import select

    from relume_worker.database.models import JobRow

    with data_folder.service.ledger.sessions() as session:
        query = select(JobRow).where(JobRow.kind == table.name).order_by(JobRow.created.desc())
        return list(session.scalars(query))


def list_jobs(data_folder: OpenFolder, noun: str) -> Iterator[tuple[dict[str, Any], str]]:
    """Jobs as in the database, as JSON and as lines; only the server knows the progress within a step."""
    table = job_tables()[noun]
    return (describe_job(row, table) for row in job_rows(data_folder, table))


def describe_job(row: JobRow, table: JobTable) -> tuple[dict[str, Any], str]:
    """A job as JSON and as a line."""
    from relume_cli.terminal.printing import iso_time
    from relume_worker.jobs.job import read_row

    request, state, problem = read_row(row, table.placeholder)
    total, fields = table.total(request), {name: getattr(request, name) for name in table.fields}
    counts = {"state": state, "done": row.done, "total": total}
    document = {"id": row.id, **fields, **counts, "problem": problem, "created": iso_time(row.created)}
    return document, f"{row.id}  {state:9}  {row.done} of {total} {table.unit}  {table.title(request)}"


def find_job(data_folder: OpenFolder, noun: str, name: str) -> JobRow:
    """Find a job by its id or the start of one. Raises NotFoundError."""
    from relume_cli.name_lookup import pick

    rows = {row.id: row for row in job_rows(data_folder, job_tables()[noun])}
    return rows[pick(noun, name, [(identity, identity) for identity in rows], f"relume list {noun}s names them")]


def find_any_job(data_folder: OpenFolder, name: str) -> tuple[str, JobRow] | None:
    """Find a job of any kind by its id: its noun and row; None if there is none."""
    from relume_worker.database.models import JobRow

    nouns = {table.name: noun for noun, table in job_tables().items()}
    with data_folder.service.ledger.sessions() as session:
        row = session.get(JobRow, name)
    return None if row is None or row.kind not in nouns else (nouns[row.kind], row)


def delete_job(data_folder: OpenFolder, noun: str, identity: str) -> None:
    """Stop a job, and delete its files."""
    table = job_tables()[noun]
    files = data_folder.settings.data / table.folder / identity
    shutil.rmtree(files, ignore_errors=True)  # first, because deleting a row needs space, too
    data_folder.service.jobs.ledger.delete([identity])
    shutil.rmtree(files, ignore_errors=True)  # of a step that has ended in between
    data_folder.access.quotas.disown(table.owned, identity)
