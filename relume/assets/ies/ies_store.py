"""Store of IES files, in `relume.assets.asset_store`.

    <folder>/<id>/web.npy       relative intensity, see `relume.assets.ies.read_ies.PhotometricWeb`
                  source.ies    the file, for exports; old assets lack it
                  ies.json      name, warnings and maximum intensity

Looks refer to one as "ies:<id>".
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.ies.ies_file import IesFile
from relume.assets.ies.read_ies import AZIMUTHS, POLAR_ANGLES, read_ies
from relume.assets.small_asset_store import SmallAssetRecord, SmallAssetStore
from relume.core.cache import asset_cached
from relume.core.color import LUMENS_PER_WATT
from relume.core.errors import SceneError
from relume.core.validation import Pointer, invalid_value

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class IesRecord(SmallAssetRecord):
    """An IES file in lists. candela: maximum intensity."""

    candela: float

    @property
    def emission(self) -> float:
        """Emission of a light with the intensity of the file, W/sr."""
        return self.candela / LUMENS_PER_WATT


IES_FILES = SmallAssetStore("IES file", "ies:", "ies.json", SceneError, max_entries=1_000, record_type=IesRecord)
_WEB, _SOURCE = "web.npy", "source.ies"


def store_ies(folder: Path, source: Path, name: str) -> IesRecord:
    """Import an IES file; an existing one with this content gets the new name.

    Args:
        folder: folder of the asset store. source: the file. name: shown to users.
    Raises:
        SceneError: the file is unusable, or the store is full.
    """
    web, warnings = read_ies(source, name)

    def fill(staged_folder: Path) -> dict[str, Any]:
        np.save(staged_folder / _WEB, web.relative_intensity)
        shutil.copyfile(source, staged_folder / _SOURCE)
        return {"candela": web.candela}

    return IES_FILES.import_asset(folder, source, name, warnings, fill)


def store_ies_files(folder: Path, files: Iterable[IesFile]) -> None:
    """Store the IES files of a scene. Raises SceneError as `store_ies` does."""
    for file in files:
        with tempfile.TemporaryDirectory() as temporary:
            source = Path(temporary) / _SOURCE
            source.write_bytes(file.data)
            store_ies(folder, source, file.name)


def read_source(profile: str) -> bytes | None:
    """Return the file of a light's `profile`; None for an old asset. Raises NotFoundError: it does not exist."""
    path = IES_FILES.resolve(profile) / _SOURCE
    return path.read_bytes() if path.is_file() else None


def load_web(profile: str) -> Shaped[F32, "polar azimuth"]:
    """Load the web of a light's `profile`; see `PhotometricWeb.relative_intensity`.

    Raises:
        NotFoundError: it does not exist. SceneError: its files are damaged.
    """
    return _load_web(IES_FILES.resolve(profile))


def load_planes(profile: str) -> list[list[float]]:
    """Load the planes C0, C90, C180 and C270 of a web, every 5°, for plots. Raises what `load_web` raises."""
    web = load_web(profile)
    step, columns = 5 * (POLAR_ANGLES - 1) // 180, [k * (web.shape[1] - 1) // 4 for k in range(4)]
    return [[round(float(value), 4) for value in web[::step, column]] for column in columns]


@asset_cached("IES web")
def _load_web(path: Path) -> F32:
    web = np.asarray(IES_FILES.open_array(path, _WEB))
    if web.dtype != np.float32 or web.shape not in ((POLAR_ANGLES, 1), (POLAR_ANGLES, AZIMUTHS)):
        raise IES_FILES.damaged_error(path)
    return web


def check_profile(pointer: Pointer, profile: Any) -> None:
    """Raise ParameterError unless a light's `profile` is null or an IES file that was uploaded.

    Args:
        pointer: location in the look. profile: the value there.
    """
    if profile is not None and not (isinstance(profile, str) and IES_FILES.exists(profile)):
        raise invalid_value(pointer, profile, "null, or an IES file that was uploaded to /api/ies")
