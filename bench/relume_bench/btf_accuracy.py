"""btf.*: error of BTF rendering against the geometry and the uncompressed values.

`btf.geometry_rmse`: a plane covered with the woven BTF, under an environment, against Mitsuba's paths through the
actual small geometry, from a view between the directions of the BTF. The noise is removed. `btf.sphere_rmse`: the same
on a ball. `btf.table_rmse`: the plane's view samples against sums over all uncompressed values.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from relume.assets.btf.btf_store import STORE
from relume_bench.btf_pictures import against_geometry, against_table
from relume_bench.btf_sphere import against_displaced
from relume_bench.btf_synthetic import SyntheticBtf, open_values_folder
from relume_bench.figure import Figure

_BOUND, _FINE = 0.05, 0.02  # of images, and of the comparison with all values


def measure(tiny: bool) -> list[Figure]:
    """Make a weave, and compare its images with the actual geometry."""
    with (
        open_values_folder(tiny) as values_folder,
        tempfile.TemporaryDirectory() as folder,
        STORE.with_search_folder(Path(folder) / "btfs"),
    ):
        folder_path, synthetic_btf = Path(folder), SyntheticBtf("weave", values_folder, tiny)
        record = synthetic_btf.save(folder_path, _BOUND)
        return [
            against_geometry(record, folder_path, tiny),
            against_displaced(record, folder_path, tiny),
            against_table(synthetic_btf.save(folder_path, _FINE), synthetic_btf.values, folder_path, tiny),
        ]
