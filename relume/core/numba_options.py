"""Compiler options for kernels that allocate no arrays and return none: `@nb.njit(…, **NO_REFCOUNT)`.

They do not count references to their arguments or to views that live for one loop iteration
(docs/adr/0009-numba-and-embree.md).
"""

from __future__ import annotations

from typing import Any

NO_REFCOUNT: Any = {"_nrt": False}  # Numba's type stubs lack this option
