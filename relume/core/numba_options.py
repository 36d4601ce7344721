"""How kernels are compiled that make no arrays and return none: `@nb.njit(…, **UNCOUNTED)`.

They count no references to those that they are handed, nor to views that live for one round of a loop
(docs/adr/0009-numba-and-embree.md).
"""

from __future__ import annotations

from typing import Any

UNCOUNTED: Any = {"_nrt": False}  # an option that Numba's types do not know
