"""`concurrent.futures` on a Dask cluster, where every future ends.

Dask's own executor leaves a future pending for ever when a worker dies with a result that nobody had fetched yet and
the repeated task then fails: a bake would wait for it without end.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Any

from relume.core.errors import RelumeError


@dataclass(frozen=True)
class _FailedCall:
    """What a call has raised, on its way back."""

    error: Exception


def _attempt(fn: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    """Call it in the worker. A full disk is what the bake says, once; raised here, Dask would log it with its trace."""
    try:
        return fn(*args, **kwargs)
    except (RelumeError, OSError, MemoryError) as error:
        return _FailedCall(error)


class DaskExecutor(Executor):
    """Tasks of one Dask client, each run even where its like has run before."""

    def __init__(self, client: Any) -> None:
        """
        Args:
            client: a connected `distributed.Client`; whoever made it closes it.
        """
        self._client = client

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Hand a call out. Its future raises KilledWorker where the worker died, CancelledError where all went away."""
        task = self._client.submit(_attempt, fn, *args, pure=False, **kwargs)
        outcome: Future[Any] = Future()
        self._client.loop.add_callback(_forward_outcome, task, outcome)
        return outcome


async def _forward_outcome(task: Any, outcome: Future[Any]) -> None:
    """Give a Dask future's outcome to `outcome`; runs in the client's loop."""
    try:
        result = await task
    except (concurrent.futures.CancelledError, asyncio.CancelledError):
        outcome.cancel()
        outcome.set_running_or_notify_cancel()  # or nobody who waits would wake
    except Exception as error:
        outcome.set_exception(error)
    else:
        if isinstance(result, _FailedCall):
            outcome.set_exception(result.error)
        else:
            outcome.set_result(result)
