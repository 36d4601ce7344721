"""Layers of a USD scene, opened in a private folder.

A layer may name any path of the machine. Each layer is therefore written into a temporary folder under a name of its
own, and every path in it is replaced: by the name of another layer there, or by a key of `LayerFolder.assets` for an
image, or it is removed. A stage of these layers opens no other file.
"""

from __future__ import annotations

import posixpath
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, quote, unsupported
from relume.scene_io.obj_ply.material_maker import printable, read_companion
from relume.scene_io.referenced_files import Archive, Companions
from relume.scene_io.root_layer import FORMAT_ARGUMENTS, layer_paths, open_layer
from relume.scene_io.usd.materialx_layers import write_materialx_layer
from relume.scene_io.usd.value_types import remove_mistyped
from relume.scene_io.zip_scene import LAYER_SUFFIXES, open_zip

MATERIALX_SUFFIX = ".mtlx"
MAX_LAYERS = 1_000
MAX_DEPTH = 32  # of packages and layers that name one another
ERROR = re.compile(r"In <([^>]*)>: ([^@<]+)")
_USERS = {"image": "a texture", "layer": "a layer", "IES file": "a light"}  # of each kind of file
INSTALL = "USD files need usd-core: pip install relume[usd]"


@dataclass(frozen=True)
class LayerAsset:
    """A file that a layer names: relative to the folder of the scene, or to that of a package's first layer."""

    companions: Companions
    name: str


class LayerFolder:
    """A private folder with the layers of one scene.

    Attributes:
        assets: the other files that layers name, by the key that the stage has for each.
    """

    def __init__(self, path: Path, warnings: list[ImporterWarning]) -> None:
        from pxr import UsdUtils

        self._diagnostics = UsdUtils.CoalescingDiagnosticDelegate()  # otherwise USD writes to stderr
        self._path, self._warnings = path.resolve(), warnings
        self._layers: dict[str, Any] = {}  # by private name; USD forgets the changes of a layer without a reference
        self._names: dict[LayerAsset, str] = {}
        self._packages: dict[LayerAsset, tuple[bytes, Archive] | None] = {}
        self.assets: dict[str, LayerAsset] = {}

    def open_stage(self, data: bytes, companions: Companions) -> Any:
        """Open a root layer, and all layers that it needs.

        Args:
            data: text or crate. companions: files that it may name.
        Raises:
            SceneError: the root layer is damaged, or there are too many layers.
        """
        from pxr import Tf, Usd

        name = self._add(data, companions, "", 0)
        if not name:
            raise SceneError("the USD file is damaged; export it again")
        try:
            stage = Usd.Stage.Open(self._layers[name])
        except Tf.ErrorException:
            raise SceneError("the layers of the USD file cannot be composed; export it again") from None
        self._warn_errors([problem.commentary for problem in self._diagnostics.TakeUncoalescedDiagnostics()])
        for layer in stage.GetUsedLayers():
            if not layer.anonymous and not Path(layer.realPath).is_relative_to(self._path):
                raise SceneError("the USD file opens a layer outside its folder; put all layers next to it")
        return stage

    def _warn_errors(self, messages: list[str]) -> None:
        """One warning for all errors of the composition."""
        errors = [match for message in messages if (match := ERROR.search(message))]
        if errors:
            more = f" ({len(errors) - 1} more)" if len(errors) > 1 else ""
            prim, error = errors[0].groups()
            message = f"USD reports for {quote(prim)}: {quote(error.strip().lower())}{more}; that is left out."
            self._warnings.append(unsupported(message))

    def _add(self, data: bytes, companions: Companions, folder: str, depth: int) -> str:
        """Write a layer and those that it names; return its private name, empty if it is damaged."""
        name = self._next_name(depth)
        layer = open_layer(data, self._path / name)
        if layer is None:
            return ""
        self._keep(name, layer, companions, folder, depth)
        return name

    def _next_name(self, depth: int) -> str:
        """The private name of the next layer. Raises SceneError if there are too many."""
        if len(self._layers) == MAX_LAYERS or depth > MAX_DEPTH:
            raise SceneError(f"the USD file has more than {MAX_LAYERS:,} layers or nests them too deeply; flatten it")
        return f"layer-{len(self._layers)}.usd"

    def _keep(self, name: str, layer: Any, companions: Companions, folder: str, depth: int) -> None:
        """Store a layer, and replace the names of files in it."""
        from pxr import UsdUtils

        self._layers[name] = layer
        paths = {path: self._private_path(path, companions, folder, depth) for path in layer_paths(layer)}
        UsdUtils.ModifyAssetPaths(layer, lambda path: paths.get(path, ""))
        _remove_clips(layer, self._warnings)
        remove_mistyped(layer, self._warnings)

    def _private_path(self, path: str, companions: Companions, folder: str, depth: int) -> str:
        """The private path of a file that a layer names; empty if it is missing."""
        outer, _, inner = path.split(FORMAT_ARGUMENTS)[0].removesuffix("]").partition("[")
        asset = LayerAsset(companions, posixpath.normpath(posixpath.join(folder, outer.replace("\\", "/"))))
        if inner:
            package = self._open_package(asset)
            if package is None:
                return ""
            asset = LayerAsset(package[1], posixpath.relpath(inner, package[1].folder or "."))
        if not asset.name.lower().endswith((*LAYER_SUFFIXES, MATERIALX_SUFFIX)):
            key = f"asset-{len(self.assets)}"
            self.assets[key] = asset
            return key
        if asset not in self._names:
            self._names[asset] = f"layer-{len(self._layers)}.usd"  # layers may name one another
            self._names[asset] = self._add_named(asset, depth + 1)
        return self._names[asset]

    def _add_named(self, asset: LayerAsset, depth: int) -> str:
        if asset.name.lower().endswith(".usdz"):
            package = self._open_package(asset)
            return "" if package is None else self._add(*package, "", depth)
        data = self.read(asset, "layer")
        if data is None:
            return ""
        folder = posixpath.dirname(asset.name)
        if asset.name.lower().endswith(MATERIALX_SUFFIX):
            return self._add_materialx(data, asset, folder, depth)
        name = self._add(data, asset.companions, folder, depth)
        if not name:
            self._warnings.append(unsupported(f"Skipped the layer “{printable(asset.name)}”: it is damaged."))
        return name

    def _add_materialx(self, data: bytes, asset: LayerAsset, folder: str, depth: int) -> str:
        """Add a MaterialX document as a layer; return its private name, empty if it cannot be used."""
        name = self._next_name(depth)
        try:
            layer = write_materialx_layer(data, str(self._path / name))
        except SceneError as error:
            self._warnings.append(unsupported(f"Skipped “{printable(asset.name)}”: {error}."))
            return ""
        self._keep(name, layer, asset.companions, folder, depth)
        return name

    def _open_package(self, asset: LayerAsset) -> tuple[bytes, Archive] | None:
        """The first layer of a .usdz file, and its other files; None with a warning if it cannot be used."""
        if asset not in self._packages:
            self._packages[asset] = None
            data = self.read(asset, "layer")
            try:
                self._packages[asset] = None if data is None else open_zip(data)
            except SceneError as error:
                self._warnings.append(unsupported(f"Skipped “{printable(asset.name)}”: {error}."))
        return self._packages[asset]

    def read(self, asset: LayerAsset, kind: str) -> bytes | None:
        """Read a file; None with a warning if it is missing. kind: of `_USERS`."""
        return read_companion(asset.companions, "", asset.name, _USERS[kind], self._warnings, kind)


def _remove_clips(layer: Any, warnings: list[ImporterWarning]) -> None:
    """Remove value clips: USD opens their layers when it reads values, by patterns of names."""
    from pxr import Sdf

    clipped: list[Any] = []

    def find(path: Any) -> None:
        spec = layer.GetObjectAtPath(path)
        if isinstance(spec, Sdf.PrimSpec) and spec.HasInfo("clips"):
            clipped.append(spec)

    layer.Traverse(Sdf.Path.absoluteRootPath, find)
    for spec in clipped:
        spec.ClearInfo("clips")
        warnings.append(unsupported(f"Value clips of {quote(spec.name)} aren't supported; it has its default values."))
