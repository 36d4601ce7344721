"""`concurrent.futures` on a Dask cluster, in which every future completes.

Dask's own executor leaves a future pending forever if a worker dies with an unfetched result and the repeated task
fails: a bake would never end.
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
    """Exception of a call, returned as a value."""

    error: Exception


def _attempt(fn: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    """Run the call in the worker. The bake reports a full disk once; raised here, Dask would log its traceback."""
    try:
        return fn(*args, **kwargs)
    except (RelumeError, OSError, MemoryError) as error:
        return _FailedCall(error)


class DaskExecutor(Executor):
    """Tasks of one Dask client; each runs even if an identical one has run before."""

    def __init__(self, client: Any, slot: str) -> None:
        """
        Args:
            client: a connected `distributed.Client`, which its creator closes.
            slot: Dask resource of which each task takes one.
        """
        self._client, self._place = client, slot

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Submit a call. Its future raises KilledWorker if the worker died, CancelledError if the cluster is gone."""
        task = self._client.submit(_attempt, fn, *args, pure=False, resources={self._place: 1}, **kwargs)
        outcome: Future[Any] = Future()
        self._client.loop.add_callback(_forward_outcome, task, outcome)
        return outcome


async def _forward_outcome(task: Any, outcome: Future[Any]) -> None:
    """Copy a Dask future's outcome to `outcome`; runs in the client's loop."""
    try:
        result = await task
    except (concurrent.futures.CancelledError, asyncio.CancelledError):
        outcome.cancel()
        outcome.set_running_or_notify_cancel()  # otherwise waiting threads would never wake
    except Exception as error:
        outcome.set_exception(error)
    else:
        if isinstance(result, _FailedCall):
            outcome.set_exception(result.error)
        else:
            outcome.set_result(result)
