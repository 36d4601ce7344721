"""relume: edit materials and lights in the rendered image. Numerics and file formats; no web and no process code."""

import os

# Kernels use their own threads on all cores. BLAS threads would spin on the same cores between products too small to
# split: splitting a rotated environment takes 4 ms with one BLAS thread and 25 to 500 ms with two under load.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from relume.core.numba_cache import use_kernel_cache

use_kernel_cache()
