"""Worker processes that join an existing scheduler."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
import tempfile
from urllib.parse import urlsplit

import dask
from distributed import Nanny

from relume.core.errors import ParameterError, PlanError
from relume_worker.executor import (
    DASK_CONFIG,
    SINGLE_THREAD_ENV,
    WORKER_PRELOAD,
    WORKER_SLOTS,
    check_certificates,
    num_cores,
)

log = logging.getLogger(__name__)

JOIN_S = 120


def join(scheduler: str, num_processes: int | None = None) -> int:
    """Run worker processes until SIGINT or SIGTERM, or until the scheduler is gone.

    Args:
        scheduler: tcp://host:port, or tls://.
        num_processes: None: one per core.
    Returns:
        Exit code: 0 after a signal, 1 if the scheduler is gone.
    Raises:
        ParameterError: the address is malformed. PlanError: the scheduler does not answer, or certificates are missing.
    """
    address = urlsplit(scheduler)
    if address.scheme not in ("tcp", "tls") or not address.hostname:
        raise ParameterError("--scheduler", scheduler, "an address such as tcp://scheduler:8786")
    check_certificates(scheduler)
    with dask.config.set(DASK_CONFIG):
        return asyncio.run(_join(scheduler, num_processes or num_cores()))


async def _join(scheduler: str, num_processes: int) -> int:
    stop_requested = asyncio.Event()
    loop = asyncio.get_running_loop()
    for name in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(name, stop_requested.set)
    nannies = [_nanny(scheduler) for _ in range(num_processes)]
    async with contextlib.AsyncExitStack() as stack:
        try:
            for nanny in nannies:
                await stack.enter_async_context(nanny)
        except Exception as error:
            raise PlanError(f"the scheduler {scheduler} does not answer ({error}); start it first") from error
        log.info("%d worker processes joined %s", num_processes, scheduler)
        ends = [asyncio.ensure_future(nanny.finished()) for nanny in nannies]  # type: ignore[no-untyped-call]
        stop = asyncio.ensure_future(stop_requested.wait())
        await asyncio.wait([stop, *ends], return_when=asyncio.FIRST_COMPLETED)
    return 0 if stop_requested.is_set() else 1


def _nanny(scheduler: str) -> Nanny:
    return Nanny(
        scheduler,
        nthreads=len(WORKER_SLOTS),
        resources=WORKER_SLOTS,
        dashboard=False,
        local_directory=tempfile.gettempdir(),
        death_timeout=JOIN_S,
        env=SINGLE_THREAD_ENV,
        preload=WORKER_PRELOAD,
    )
