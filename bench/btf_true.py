"""btf.*: how near BTFs are to what they stand for.

`btf.geometry_rmse`: a plane that is covered with the woven BTF, under a sky, against Mitsuba's paths through the real
small geometry on the same place, seen from between the directions that the BTF was made for. Its noise is taken off.
`btf.sphere_rmse`: the same about a ball. `btf.table_rmse`: the plane's view samples against sums over all values before
compression.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from bench.btf_made import Made, kept_folder
from bench.btf_pictures import against_geometry, against_table
from bench.btf_sphere import against_displaced
from bench.figure import Figure
from relume.btf.shelf import STORE

_BOUND, _FINE = 0.05, 0.02  # of pictures, and of what is compared with all values


def measure(tiny: bool) -> list[Figure]:
    """Make a weave, and compare its pictures with the real one's."""
    with kept_folder(tiny) as kept, tempfile.TemporaryDirectory() as folder, STORE.at(Path(folder) / "btfs"):
        at, made = Path(folder), Made("weave", kept, tiny)
        record = made.kept(at, _BOUND)
        return [
            against_geometry(record, at, tiny),
            against_displaced(record, at, tiny),
            against_table(made.kept(at, _FINE), made.values, at, tiny),
        ]
