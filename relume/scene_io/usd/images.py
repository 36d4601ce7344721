"""Images and IES files that layers name."""

from __future__ import annotations

from dataclasses import dataclass, replace

from relume.core.import_warnings import ImporterWarning
from relume.scene_io.obj_ply.material_maker import printable
from relume.scene_io.surfaces.surface_images import first_tile
from relume.scene_io.usd.layers import LayerFolder


@dataclass(frozen=True)
class LayerImages:
    """Image files of a stage, by the key that it has for each."""

    layers: LayerFolder
    warnings: list[ImporterWarning]

    def read(self, file: str, label: str) -> bytes | None:
        """See `DocumentFiles.read`."""
        asset = self.layers.assets.get(file)
        if asset is None:
            return None
        kind = "IES file" if asset.name.lower().endswith(".ies") else "image"
        return self.layers.read(replace(asset, name=first_tile(asset.name, self.warnings)), kind)

    def printable_name(self, file: str) -> str:
        """See `DocumentFiles.printable_name`."""
        return printable(self.layers.assets[file].name)
