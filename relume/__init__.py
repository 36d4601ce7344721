"""relume: edit materials and lights in the finished picture. Numerics and file formats; no web and no process code."""

import os

# Kernels have threads of their own for all cores. Those of linear algebra would spin for the same cores between
# products too small to share: dividing a turned sky takes 4 ms by one thread, and 25 to 500 ms by two beside others.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from relume.core.numba_cache import use_kernel_cache

use_kernel_cache()
