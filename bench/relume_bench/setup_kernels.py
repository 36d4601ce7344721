"""setup.kernels_s: processor time of compiling all kernels, as `make setup` does on a fresh machine.

`python -m relume.precompile` with an empty cache, user and system time of both of its processes. The context has the
seconds that pass.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile

from relume.core.thread_pools import num_threads
from relume_bench.figure import Figure
from relume_bench.timing import seconds

_COMMAND = sys.executable, "-m", "relume.precompile"


def measure(tiny: bool) -> list[Figure]:
    """Compile once; a trial run uses the kernels that exist."""
    with tempfile.TemporaryDirectory() as folder:
        environment = dict(os.environ) if tiny else os.environ | {"XDG_CACHE_HOME": folder}
        before = _processor_s()
        wall_s = seconds(lambda: subprocess.run(_COMMAND, env=environment, check=True, capture_output=True))
        return [Figure("setup.kernels_s", _processor_s() - before, "s", {"wall_s": wall_s, "threads": num_threads()})]


def _processor_s() -> float:
    """Processor time of all child processes that have ended, seconds."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime
