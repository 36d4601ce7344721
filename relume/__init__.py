"""relume: edit materials and lights in the finished picture. Numerics and file format; no web, no process code."""

from relume.kernel_cache import use_kernel_cache

use_kernel_cache()
