"""A small synthetic BTF in the library, made once; bakes skip the measurement of their error."""

import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from shared_bakes import unmeasured

from relume.assets.btf.btf_store import STORE, BtfRecord
from relume.assets.btf.direction_rings import ubo_grid
from relume.assets.btf.value_cache import ValueFile
from relume.synthetic_btf.render import TileGeometry
from relume.synthetic_btf.synthesize import MESH, SyntheticBtf, synthesize_btf

__all__ = ["unmeasured"]  # a fixture

SIZE, GRID, BOUND = 16, 1, 0.02
STEPS = 24  # subdivisions along each side of the cords


class Cords(NamedTuple):
    """The stored BTF. folder: the store. record: its record. values: the values before compression."""

    folder: Path
    record: BtfRecord
    values: ValueFile


def cords(folder: Path) -> Path:
    """A tile of two cords per meter with different colors, one glossy, with uneven pile.

    It has few faces, because the light between them takes longest to compute.
    """
    glossy_material = (
        "newmtl b\nKd 0.1 0.3 0.4\nKs 0.1 0.1 0.1\nNs 9\nillum 3\n"  # the Ks of a mirror is read unchanged
    )
    (folder / "m.mtl").write_text(f"newmtl a\nKd 0.6 0.4 0.2\nillum 1\n{glossy_material}")
    v, u = np.meshgrid(*[np.linspace(0, 1, STEPS + 1)] * 2, indexing="ij")
    height = 0.08 * np.sin(2 * np.pi * u) ** 2 + 0.02 * np.cos(2 * np.pi * (u + 2 * v))
    lines = ["mtllib m.mtl", *(f"v {x} {y} {-z}" for x, y, z in zip(u.flat, height.flat, v.flat, strict=True))]
    for column in range(STEPS):
        lines.append("usemtl " + "ab"[2 * column // STEPS])
        for first in range(column + 1, (STEPS + 1) * STEPS, STEPS + 1):
            lines.append(f"f {first} {first + 1} {first + STEPS + 2} {first + STEPS + 1}")
    path = folder / "cords.obj"
    path.write_text("\n".join(lines))
    return path


@pytest.fixture(scope="session")
def small_btf(tmp_path_factory):
    folder, rendered = tmp_path_factory.mktemp("btf"), tmp_path_factory.mktemp("values")
    synthetic_btf = SyntheticBtf(MESH, SIZE, GRID, BOUND, cords(tmp_path_factory.mktemp("geometry")))
    values = ValueFile(rendered, ubo_grid(), (SIZE, SIZE))
    small = TileGeometry(synthetic_btf.tile(), ubo_grid(), (SIZE, SIZE), GRID, 1)
    values.fill(small.get_view, lambda fraction: None, lambda: False)
    partial_folder = folder / "begun"  # resumes near its end
    shutil.copytree(rendered, partial_folder)
    with STORE.with_search_folder(folder):
        yield Cords(
            folder,
            synthesize_btf(folder, synthetic_btf, "Cords", lambda fraction: None, lambda: False, partial_folder),
            values,
        )
