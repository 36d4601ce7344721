"""Environments, IES files and LUTs for `relume list` and `relume delete`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from relume_cli.terminal.printing import iso_time

if TYPE_CHECKING:
    from relume.assets.small_asset_store import SmallAssetRecord, SmallAssetStore

SmallAssetKind = Literal["environment", "ies", "lut"]


class SmallAssets(NamedTuple):
    """Assets of one kind.

    Attributes:
        store: their store. folder: returns its folder in a data folder. field: of looks, which names one.
    """

    store: SmallAssetStore[Any]
    folder: Callable[[Path], Path]
    field: str

    def document(self, record: SmallAssetRecord) -> dict[str, Any]:
        """Return an entry of a list as JSON."""
        return {
            "id": record.id,
            self.field: record.reference,
            "name": record.name,
            "created": iso_time(record.created),
            "warnings": list(record.warnings),
        }


def small_assets(kind: SmallAssetKind) -> SmallAssets:
    """Return the assets of a kind, whose modules are loaded now."""
    from relume_worker import paths

    match kind:
        case "environment":
            from relume.assets.environments.environment_store import STORE

            return SmallAssets(STORE, paths.environments_path, "map")
        case "ies":
            from relume.assets.ies.ies_store import IES_FILES

            return SmallAssets(IES_FILES, paths.ies_path, "profile")
        case "lut":
            from relume.luts.lut_store import LUTS

            return SmallAssets(LUTS, paths.luts_path, "lut")
