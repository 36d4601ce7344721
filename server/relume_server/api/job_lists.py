"""Helpers shared by the routes of renders, comparisons and BTF jobs."""

from __future__ import annotations

from typing import Annotated, TypeVar

from pydantic import BaseModel, Field

from relume_server.api.pagination import MAX_LONG, Key, Page, newest
from relume_server.schemas.bodies import format_timestamp
from relume_worker.jobs.job import Job, JobFilter
from relume_worker.jobs.job_kind import JobKind

Request = TypeVar("Request", bound=BaseModel)
UserName = Annotated[str, Field(max_length=80)]


def list_jobs(
    kind: JobKind[Request],
    job_filter: JobFilter,
    page: Page,
    default_limit: int = MAX_LONG,
    *,
    newest_first: bool = True,
) -> list[Job[Request]]:
    """Return a page of the jobs of a kind. default_limit: number without a `limit`."""

    def key(job: Job[Request]) -> Key:
        return newest(job.created, job.id) if newest_first else (job.created, job.id)

    page.check((0.0, ""))
    after = None
    if page.after is not None:
        created, identity = float(page.after[0]), str(page.after[1])
        after = -created if newest_first else created, identity
    jobs = kind.page(job_filter, page.default_limit(default_limit) + 1, after, newest_first=newest_first)
    return page.cut(jobs, key)


def format_timestamps(job: Job[Request]) -> dict[str, str | None]:
    """Format the times of a job for its body."""
    times = {"created": job.created, "started": job.started, "ended": job.ended}
    return {name: None if at is None else format_timestamp(at) for name, at in times.items()}
