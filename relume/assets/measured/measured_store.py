"""Store of imported measured materials, in `relume.assets.asset_store`.

    <folder>/<id>/measured.binary    the imported file; of another layout than MERL, its conversion
                  table.npy          its table for `relume.assets.measured.interpolate`
                  material.json      name, warnings, curves and their errors without the quotient

Looks refer to one as "merl:<id>".
"""

from __future__ import annotations

import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Shaped

from relume.assets.asset_store import AssetStore
from relume.assets.measured.factorize import factorize
from relume.assets.measured.interpolate import F32, NUM_KNOTS, build_table
from relume.assets.measured.merl import F64, SHAPE, write_merl
from relume.assets.measured.read_measured import read_measured
from relume.core.cache import asset_cached
from relume.core.errors import MaterialError

STORE = AssetStore("measured material", "merl:", "material.json", MaterialError, max_entries=500)
_SOURCE, _TABLE = "measured.binary", "table.npy"
Rgb = tuple[float, float, float]


@dataclass(frozen=True)
class MaterialRecord:
    """A measured material in lists.

    Attributes:
        created: seconds since 1970.
        lobes_error, homomorphic_error: errors of the curves without the quotient, see
            `relume.assets.measured.factorize.MeasuredFactors`.
        warnings: what the conversion from another layout changed.
    """

    id: str
    name: str
    created: float
    lobes_error: Rgb
    homomorphic_error: Rgb
    warnings: tuple[str, ...] = ()

    @property
    def data(self) -> str:
        """Name of the material in looks."""
        return STORE.prefix + self.id

    def terms(self) -> list[dict[str, Any]]:
        """Terms of the material in a look, without textures, since the measurement includes the color."""
        return [{"model": model, "data": self.data, "texture": None} for model in ("measured_lv", "measured_hd")]


@dataclass(frozen=True)
class MeasuredBrdf:
    """The data of a material's quotients and curves. lobes, homomorphic: as in `MeasuredFactors`."""

    table: Shaped[F32, "90 90 180 3"]
    lobes: Shaped[F64, "4 3 90"]
    homomorphic: Shaped[F64, "4 3 90"]


def store_material(folder: Path, source: Path, name: str, file_name: str | None = None) -> MaterialRecord:
    """Import a file of any layout; takes some seconds and 0.5 GB. An existing one with this content gets the new name.

    Args:
        folder: folder of the asset store.
        source: the file to import.
        name: shown to users.
        file_name: file name in errors; None for the name in the path.
    Raises:
        MaterialError: the file is unusable, or the store is full.
    """
    measurement, is_merl = read_measured(source, file_name)

    def fill(staged_folder: Path) -> dict[str, Any]:
        table = build_table(measurement.planes)
        if is_merl:
            shutil.copyfile(source, staged_folder / _SOURCE)
        else:
            write_merl(staged_folder / _SOURCE, measurement.planes)
        np.save(staged_folder / _TABLE, table)
        factors = asdict(factorize(measurement.planes, table))
        return {key: np.asarray(value).tolist() for key, value in factors.items()} | {"warnings": measurement.warnings}

    return get_record(folder, STORE.store(folder, source, name, fill))


def records(folder: Path) -> list[MaterialRecord]:
    """Return all materials of a folder, newest first."""
    return STORE.records(folder, get_record)


def get_record(folder: Path, identity: str) -> MaterialRecord:
    """Return one material. Raises NotFoundError; MaterialError if its files are damaged."""
    path = STORE.path(folder, identity)
    document = STORE.load_record(path)
    try:
        lobes_error, homomorphic_error = (_rgb(document[key]) for key in ("lobes_error", "homomorphic_error"))
    except (KeyError, TypeError, ValueError) as error:
        raise STORE.damaged_error(path) from error
    warnings = document.get("warnings", [])
    if not (isinstance(warnings, list) and all(isinstance(warning, str) for warning in warnings)):
        raise STORE.damaged_error(path)
    return MaterialRecord(
        identity, document["name"], document["created"], lobes_error, homomorphic_error, tuple(warnings)
    )


def source_path(data: str) -> Path:
    """Return the path of the measurement in the MERL layout. Raises NotFoundError."""
    return STORE.resolve(data) / _SOURCE


def load_material(data: str) -> MeasuredBrdf:
    """Load the measured BRDF of a look's `data`; its table is memory-mapped.

    Raises:
        NotFoundError: it does not exist. MaterialError: its files are damaged.
    """
    return _load(STORE.resolve(data))


@asset_cached("measured material")
def _load(path: Path) -> MeasuredBrdf:
    document, table = STORE.load_record(path), STORE.open_array(path, _TABLE)
    try:
        curves = [np.array(document[key], np.float64) for key in ("lobes", "homomorphic")]
    except (ValueError, KeyError, TypeError) as error:
        raise STORE.damaged_error(path) from error
    if table.shape != (*SHAPE, 3) or table.dtype != np.float32:
        raise STORE.damaged_error(path)
    for curve in curves:
        if curve.shape != (4, 3, NUM_KNOTS) or not (np.isfinite(curve) & (curve > 0)).all():
            raise STORE.damaged_error(path)
    return MeasuredBrdf(table, *curves)


def _rgb(values: Any) -> Rgb:
    red, green, blue = (float(value) for value in values)
    return red, green, blue
