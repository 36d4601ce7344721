"""Layers of USD before they are composed: their kind, the files that they name, and the root of several."""

from __future__ import annotations

import codecs
import posixpath
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

MAGIC = (b"PXR-USDC", b"#usda", b"#sdf")  # crate, and text
FORMAT_ARGUMENTS = ":SDF_FORMAT_ARGS:"


def is_usd(data: bytes) -> bool:
    """True if bytes are a layer: text or crate."""
    return data.removeprefix(codecs.BOM_UTF8).startswith(MAGIC)


def find_roots(layers: Mapping[str, bytes]) -> list[str]:
    """Names of the layers that no other one names, without those that are damaged.

    Args:
        layers: contents by their paths in an archive.
    """
    named: set[str] = set()
    readable: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, data) in enumerate(layers.items()):
            layer = open_layer(data, Path(folder) / f"layer-{number}.usd")
            if layer is not None:
                readable.append(name)
                paths = (path.split(FORMAT_ARGUMENTS)[0].partition("[")[0] for path in layer_paths(layer))
                joined = (posixpath.normpath(posixpath.join(posixpath.dirname(name), path)) for path in paths)
                named |= {path for path in joined if path != name}
    return [name for name in readable if name not in named]


def open_layer(data: bytes, path: Path) -> Any:
    """Write a layer to a path, and open it; None if it is damaged.

    Args:
        data: text or crate. path: in a private folder.
    """
    from pxr import Sdf, Tf

    path.write_bytes(data.removeprefix(codecs.BOM_UTF8))
    try:
        return Sdf.Layer.FindOrOpen(str(path)) if is_usd(data) else None
    except Tf.ErrorException:
        return None


def layer_paths(layer: Any) -> list[str]:
    """All names of files in a layer."""
    from pxr import UsdUtils

    paths: dict[str, str] = {}
    UsdUtils.ModifyAssetPaths(layer, lambda path: paths.setdefault(path, path))
    return [*paths]
