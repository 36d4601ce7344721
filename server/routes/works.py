"""What routes of renders, comparisons and BTFs in the making have in common."""

from __future__ import annotations

from typing import Annotated, TypeVar

from pydantic import BaseModel, Field

from server.queues.work import Work, WorkFilter
from server.queues.work_queue import WorkQueue
from server.routes.paging import MAX_LONG, Key, Page, newest
from server.wire.bodies import moment

Request = TypeVar("Request", bound=BaseModel)
UserName = Annotated[str, Field(max_length=80)]


def work_page(
    queue: WorkQueue[Request], which: WorkFilter, page: Page, most: int = MAX_LONG, *, newest_first: bool = True
) -> list[Work[Request]]:
    """A part of a queue's list. most: how long it is at most where nobody says that."""

    def key(work: Work[Request]) -> Key:
        return newest(work.created, work.id) if newest_first else (work.created, work.id)

    page.check((0.0, ""))
    after = None
    if page.after is not None:
        created, identity = float(page.after[0]), str(page.after[1])
        after = -created if newest_first else created, identity
    works = queue.page(which, page.at_most(most) + 1, after, newest_first=newest_first)
    return page.cut(works, key)


def moments(work: Work[Request]) -> dict[str, str | None]:
    """When it was asked for, begun and ended, as bodies say it."""
    times = {"created": work.created, "started": work.started, "ended": work.ended}
    return {name: None if at is None else moment(at) for name, at in times.items()}
