"""A simulated server: `python -m relume_bench.scaling.server FRAME_S`, with settings from RELUME_ variables.

A line on its input is answered by a line of JSON: processor time, memory, frames, ledger calls. It stops at the end of
its input.
"""

from __future__ import annotations

import json
import resource
import sys
import threading
import time

from relume.core.memory_usage import limit_malloc_arenas
from relume_bench.scaling.fakes import SleepingSteps, library_opener, open_idle_bakes
from relume_bench.scaling.ledger_calls import LedgerCalls
from relume_server.app import create_app, create_server
from relume_server.settings import Settings


def _main() -> None:
    limit_malloc_arenas()
    settings, calls = Settings(), LedgerCalls()
    opener = library_opener(float(sys.argv[1]))
    app = create_app(settings, open_library=opener, open_steps=SleepingSteps, open_bakes=open_idle_bakes)
    process = create_server(app, settings)

    def answer() -> None:
        for _ in sys.stdin:
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            state = {"cpu_s": time.process_time(), "peak_kb": memory, "time_s": time.monotonic(), **calls.read()}
            print(json.dumps(state), flush=True)
        process.should_exit = True

    threading.Thread(target=answer, daemon=True).start()
    process.run()


if __name__ == "__main__":
    _main()
