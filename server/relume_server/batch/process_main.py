"""Main module of a process that runs steps.

`python -m relume_server.batch.process_main DATA BYTES THREADS NICE [CONFIG [SPACE]]`, started by
`relume_server.batch.process`; the last two as for `relume.image_io.ocio.active_config`.

Reads one line of JSON per step, or `"stop"` to cancel it; writes lines with `share`, and at last one with `answer`,
`problem` or `canceled`. It yields to everything else on the machine, and ends when the server is gone.
"""

from __future__ import annotations

import json
import logging
import os
import queue
import sys
import threading
import time
from pathlib import Path
from typing import Any

log = logging.getLogger(__name__)
_REPORT_INTERVAL_S = 0.1


def main() -> None:
    """Main function of the process."""
    data, num_bytes, num_threads = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    os.nice(int(sys.argv[4]))  # inherited by threads that start later
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # output of libraries must not mix with the answers
    os.environ["RELUME_THREADS"] = num_threads
    step_queue: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
    stop = threading.Event()
    threading.Thread(target=_listen, args=(step_queue, stop), daemon=True).start()

    # after the above, which must apply to all threads they start
    from relume.core.memory_usage import trim_heap
    from relume.image_io.ocio.active_config import using_config
    from relume_server.batch.context import BatchContext
    from relume_server.runtime.assets import using_asset_stores
    from relume_server.runtime.library import open_library

    with using_asset_stores(data), using_config(*[*sys.argv[5:7], None][:2]):
        context = BatchContext(data, open_library(num_bytes, 0))
        while True:
            message = step_queue.get()
            out.write(json.dumps(_answer(context, message, stop, out)) + "\n")
            trim_heap()


def _listen(step_queue: queue.SimpleQueue[dict[str, Any]], stop: threading.Event) -> None:
    for line in sys.stdin:
        message = json.loads(line)
        if message == "stop":
            stop.set()
        else:
            stop.clear()
            step_queue.put(message)
    os._exit(0)


def _answer(context: Any, message: dict[str, Any], stop: threading.Event, out: Any) -> dict[str, Any]:
    from relume.core.errors import CancelledError, RelumeError
    from relume_server.batch.step import Step
    from relume_server.batch.step_registry import do_step
    from relume_server.errors import make_problem

    reported_s = 0.0

    def report(fraction: float) -> None:
        nonlocal reported_s
        if (now_s := time.monotonic()) - reported_s >= _REPORT_INTERVAL_S:
            reported_s = now_s
            out.write(json.dumps({"share": fraction}) + "\n")

    try:
        return {"answer": do_step(context, Step(**message), report, stop.is_set)}
    except CancelledError:
        return {"canceled": True}
    except Exception as error:
        if not isinstance(error, RelumeError | OSError):
            log.exception("a %s failed", message["kind"])
        problem = make_problem(error)
        return {"problem": problem.detail, "kind": problem.type.rpartition(":")[2]}


if __name__ == "__main__":
    main()
