"""Links of lights in exports: collections of UsdLux, and a sentence for glTF."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from export_scenes import METAL, PLASTIC, export_of, scene_of, terms_of

from relume.export.export_scene import FORMATS, export_report
from relume.export.write_usd import write_usd
from relume.scene.model import Material, Scene
from relume.scene_io.import_scene import import_scene

LINKS = {
    "link": {"include": {"materials": ["Metal"], "objects": ["Chrome"]}},
    "shadow_link": {"exclude": {"materials": [], "objects": ["Plastic"]}},
}


def linked_scene() -> tuple[Scene, dict[str, Any]]:
    names = {"Plastic": PLASTIC, "Metal": METAL, "Chrome": METAL}
    scene = scene_of(*(Material(name, terms_of(surface)) for name, surface in names.items()))
    return scene, {"lights": {"Key": {"kind": "point", **LINKS}}}


def test_links_are_read_again_from_an_export(tmp_path: Path) -> None:
    scene, look = linked_scene()
    pytest.importorskip("pxr", reason="needs the package usd-core")
    write_usd(export_of(scene, look), tmp_path / "a.usdz")
    (light,) = import_scene(tmp_path / "a.usdz", "again").lights
    assert light.fields["link"] == light.fields["shadow_link"] == {"exclude": {"objects": ["Plastic"]}}


def test_gltf_export_says_that_it_has_no_links() -> None:
    scene, look = linked_scene()
    for document, count in ((look, 1), ({"lights": {"Key": {"kind": "point"}}}, 0)):
        omitted = export_report(export_of(scene, document), FORMATS["glb"]).omitted
        assert sum("glTF has no links" in sentence for sentence in omitted) == count
