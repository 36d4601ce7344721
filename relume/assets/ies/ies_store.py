"""Store of IES files, in `relume.assets.asset_store`.

    <folder>/<id>/web.npy     relative intensity, see `relume.assets.ies.read_ies.PhotometricWeb`
                  ies.json    name, warnings and maximum intensity

Looks refer to one as "ies:<id>".
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.asset_store import AssetStore
from relume.assets.ies.read_ies import AZIMUTHS, POLAR_ANGLES, read_ies
from relume.core.cache import asset_cached
from relume.core.color import LUMENS_PER_WATT
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, warning_of
from relume.core.validation import Pointer, invalid_value

F32 = NDArray[np.float32]

IES_FILES = AssetStore("IES file", "ies:", "ies.json", SceneError, max_entries=1_000)
_WEB = "web.npy"


@dataclass(frozen=True)
class IesRecord:
    """An IES file in lists.

    Attributes:
        created: seconds since 1970. candela: maximum intensity.
        warnings: warnings about the import, one sentence each.
    """

    id: str
    name: str
    created: float
    candela: float
    warnings: tuple[ImporterWarning, ...]

    @property
    def profile(self) -> str:
        """Name of the file in lights of looks."""
        return IES_FILES.prefix + self.id

    @property
    def emission(self) -> float:
        """Emission of a light with the intensity of the file, W/sr."""
        return self.candela / LUMENS_PER_WATT


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
        return {"candela": web.candela, "warnings": [warning.document() for warning in warnings]}

    return get_record(folder, IES_FILES.store(folder, source, name, fill))


def records(folder: Path) -> list[IesRecord]:
    """Return all IES files of a folder, newest first."""
    return IES_FILES.records(folder, get_record)


def get_record(folder: Path, identity: str) -> IesRecord:
    """Return one IES file. Raises NotFoundError; SceneError if its files are damaged."""
    path = IES_FILES.path(folder, identity)
    document = IES_FILES.load_record(path)
    candela, warnings = document.get("candela"), document.get("warnings")
    if not isinstance(candela, float) or not isinstance(warnings, list):
        raise IES_FILES.damaged_error(path)
    return IesRecord(identity, document["name"], document["created"], candela, tuple(map(warning_of, warnings)))


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
