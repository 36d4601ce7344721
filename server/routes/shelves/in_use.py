"""What looks name is not deleted under those who show it."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

from fastapi.concurrency import run_in_threadpool

from server.errors import InUseError
from server.services import Services

_MOST_NAMED = 3  # of what uses it, in a message


async def remove_unused(what: str, data: str, services: Services, remove: Callable[[], object]) -> None:
    """Remove a thing that no saved look, no link and no session of this server names.

    Args:
        what: it is called, in messages. data: its name in looks. services: the server's.
        remove: is called, off the event loop.
    Raises:
        InUseError: it is named; nothing is removed.
    """
    sessions = services.live.resumes.naming(f'"{data}"', time.monotonic())  # of the event loop
    await run_in_threadpool(partial(_remove, what, f'"{data}"', services, sessions, remove))


def _remove(what: str, said: str, services: Services, sessions: list[str], remove: Callable[[], object]) -> None:
    users = [f"look {name!r}" for name in services.looks.naming(said)]
    users += [f"link {identity}" for identity in services.shares.naming(said)]
    users += [f"a session of bake {bake}" for bake in sessions]
    if users:
        more = f" and {len(users) - _MOST_NAMED} more" if len(users) > _MOST_NAMED else ""
        raise InUseError(f"{what} is shown by {', '.join(users[:_MOST_NAMED])}{more}; change or delete these first")
    remove()
