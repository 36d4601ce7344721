"""Read measured materials of any layout, told by their content: MERL .binary, RGL .bsdf, Cornell's scattered .brdf."""

from __future__ import annotations

from pathlib import Path

from relume.assets.measured.measurement import Measurement
from relume.assets.measured.merl import read_merl
from relume.assets.measured.tensor_file import MAGIC


def read_measured(path: Path, file_name: str | None = None) -> tuple[Measurement, bool]:
    """Read a file as planes on the MERL grid.

    Args:
        file_name: file name in errors; None for the name in the path.
    Returns:
        The measurement, and whether the file has the MERL layout already.
    Raises:
        MaterialError: the file is damaged, too large, or of another kind.
    """
    label = file_name or path.name
    with path.open("rb") as file:
        start = file.read(64)
    if start.startswith(MAGIC):
        from relume.assets.measured.rgl import read_rgl

        return read_rgl(path, label), False
    from relume.assets.measured.cornell import looks_like_cornell, read_cornell  # SciPy, slow to import

    if looks_like_cornell(start):
        return read_cornell(path, label), False
    return Measurement(read_merl(path, file_name)), True
