"""accuracy.generated_*: as `relume_bench.accuracy`, in generated environments, a tenth of the view samples.

Every machine has these environments, so `make test` checks the figures; the maps are small, so it takes seconds.
"""

from __future__ import annotations

from relume_bench.accuracy import CASES, compare
from relume_bench.figure import Figure
from relume_bench.scenes import generated_environments


def measure(tiny: bool) -> list[Figure]:
    """Measure the three terms that have targets."""
    cases = tuple((name.replace(".", ".generated_", 1), term, curve) for name, term, curve in CASES)
    return compare(cases, 20 if tiny else 200, tiny, generated_environments())
