"""Steps in a worker process: what it keeps open between them, and how they report."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Mapping
from contextlib import ExitStack, nullcontext, suppress
from pathlib import Path
from typing import Any, NamedTuple

from relume.core.errors import CancelledError, RelumeError
from relume.core.memory_usage import trim_heap
from relume.core.thread_pools import all_cores
from relume.image_io.ocio.active_config import using_config
from relume_server.batch.context import BatchContext
from relume_server.batch.step_registry import do_step
from relume_server.errors import make_problem
from relume_server.runtime.assets import using_asset_stores
from relume_server.runtime.library import open_library
from relume_worker.executor import num_cores
from relume_worker.jobs.step import Step
from relume_worker.tasks import idle_timer, when_idle

log = logging.getLogger(__name__)
_REPORT_INTERVAL_S = 0.2


class ProcessSettings(NamedTuple):
    """Settings of the server that its steps need in other processes.

    Attributes:
        data: data directory, at the same path on every machine. cache_bytes: of all processes of a machine together.
        config: of OpenColorIO, and its working space, see `relume.image_io.ocio.active_config`.
        import_bytes, import_seconds: limits of sandboxed readers.
    """

    data: str
    cache_bytes: int
    config: tuple[str, ...]
    import_bytes: int
    import_seconds: int


_lock = threading.Lock()
_open: list[tuple[ProcessSettings, BatchContext, ExitStack]] = []  # at most one


def run_step(process: ProcessSettings, step: Step, progress_file: str) -> Mapping[str, Any]:
    """Run a step in this process; errors are returned as text, because not all of them can be sent.

    Args:
        process: settings. step: to run. progress_file: receives the fraction done.
    Returns:
        One of `answer`, `problem` with its `kind`, and `canceled`.
    """
    reported_s = 0.0

    def report(fraction: float) -> None:
        nonlocal reported_s
        if (now_s := time.monotonic()) - reported_s >= _REPORT_INTERVAL_S:
            reported_s = now_s
            with suppress(OSError):  # the job is deleted
                Path(progress_file).write_text(str(fraction))

    try:
        with idle_timer.keep_awake(), all_cores() if step.is_first else nullcontext():
            return {"answer": do_step(_context(process), step, report, lambda: False)}
    except CancelledError:
        return {"canceled": True}
    except Exception as error:
        if not isinstance(error, RelumeError | OSError):
            log.exception("a %s failed", step.kind)
        problem = make_problem(error)
        return {"problem": problem.detail, "kind": problem.type.rpartition(":")[2]}
    finally:
        trim_heap()


def _context(process: ProcessSettings) -> BatchContext:
    """Return the context of this process; opens it for the first step, and after the settings have changed."""
    with _lock:
        if not _open or _open[0][0] != process:
            _close()
            stack = ExitStack()
            stack.enter_context(using_asset_stores(Path(process.data)))
            stack.enter_context(using_config(*[*process.config, None][:2]))
            limits = process.import_bytes, process.import_seconds
            context = BatchContext(Path(process.data), open_library(process.cache_bytes // num_cores(), 0), limits)
            _open.append((process, context, stack))
        return _open[0][1]


def _close() -> None:
    """Forget open bakes and cached results."""
    for _, _, stack in _open:
        stack.close()
    _open.clear()


@when_idle
def _release() -> None:
    with _lock:
        _close()
