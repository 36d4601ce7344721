"""MaterialX exports, read again by our reader, with their images."""

from __future__ import annotations

import builtins
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export_scenes import METAL, PLASTIC, export_of, sample_scene, scene_of, terms_of

from relume.core.errors import SceneError
from relume.export.export_scene import FORMATS, export_report
from relume.export.write_materialx import DOCUMENT, write_materialx
from relume.scene.model import Material, Scene
from relume.scene_io.materialx.import_document import import_materialx
from relume.scene_io.surfaces.make_material import ReadMaterial
from relume.scene_io.surfaces.to_terms import CoatLayer
from relume.scene_io.zip_scene import open_zip

pytest.importorskip("MaterialX", reason="needs the package materialx")


def read_again(path: Path) -> dict[str, ReadMaterial]:
    document = import_materialx(*open_zip(path.read_bytes(), (".mtlx",), "MaterialX"))
    return {read.material.name: read for read in document.materials}


def exported(path: Path, scene: Scene, **variants: Any) -> dict[str, ReadMaterial]:
    write_materialx(export_of(scene, None, **variants), path)
    return read_again(path)


def assert_same_terms(read: Material, terms: tuple[dict[str, Any], ...]) -> None:
    assert [term["model"] for term in read.terms] == [term["model"] for term in terms]
    for term, expected in zip(read.terms, terms, strict=True):
        assert term["color"] == pytest.approx(expected["color"], abs=2e-4)
        for key, value in expected.get("params", {}).items():
            assert np.broadcast_to(term["params"][key], 3) == pytest.approx(np.broadcast_to(value, 3), abs=2e-3), key


@pytest.mark.parametrize(
    "coat",
    [
        CoatLayer(),
        CoatLayer(coat=0.8, coat_roughness=0.1),
        CoatLayer(sheen=(0.3, 0.2, 0.1), sheen_roughness=0.5),
    ],
    ids=["bare", "coat", "sheen"],
)
def test_materials_are_read_again_with_their_terms(tmp_path: Path, coat: CoatLayer) -> None:
    for name, surface in (("plastic", PLASTIC), ("metal", METAL)):
        scene = scene_of(Material(name, terms_of(surface, coat)))
        (read,) = exported(tmp_path / f"{name}.zip", scene).values()
        assert_same_terms(read.material, scene.materials[0].terms)


def test_anisotropy_is_read_again(tmp_path: Path) -> None:
    scene = scene_of(Material("Brushed", terms_of(METAL, CoatLayer(anisotropy=0.6))))
    (read,) = exported(tmp_path / "a.zip", scene).values()
    nu, nv = (read.material.terms[1]["params"][key] for key in ("nu", "nv"))
    expected = scene.materials[0].terms[1]["params"]
    assert (nu, nv) == (pytest.approx(expected["nu"], rel=1e-3), pytest.approx(expected["nv"], rel=1e-3))


def test_images_are_beside_the_document(tmp_path: Path) -> None:
    scene = sample_scene()
    read = exported(tmp_path / "a.zip", scene)
    textured, original = read["M_Textured"].material, scene.materials[0]
    assert (textured.textures["diffuse"].pixels == original.textures["diffuse"].pixels).all()
    assert textured.textures["diffuse"].wrap == ("mirror", "clamp")
    assert (textured.textures["roughness"].pixels == original.textures["roughness"].pixels).all()
    assert textured.normal_map is not None
    assert textured.normal_map.encoding is not None
    assert textured.normal_map.encoding.scale[0] == pytest.approx(0.5)
    leaf = read["M_Leaf"].material.opacity
    assert leaf is not None
    assert set(leaf.alpha.ravel()) == {0, 255}
    assert read["M_Bulb"].emission == pytest.approx((4, 2, 1))
    glass = read["M_Pane"].material.glass
    assert glass is not None
    assert glass.absorbed == pytest.approx((1, 2, 4), rel=1e-3)
    names = zipfile.ZipFile(tmp_path / "a.zip").namelist()
    assert all(name == DOCUMENT or name.startswith("textures/") for name in names)


def test_variants_are_further_materials(tmp_path: Path) -> None:
    scene = scene_of(Material('Wall \U0001f534/"', terms_of(PLASTIC)))
    red = {"materials": {'Wall \U0001f534/"': {"terms": [{"model": "lambert", "color": [0.8, 0.1, 0.1]}]}}}
    first, second = exported(tmp_path / "a.zip", scene, red=red).values()
    assert first.material.terms[0]["color"] != second.material.terms[0]["color"]
    assert second.material.terms[0]["color"] == pytest.approx([0.8, 0.1, 0.1])


def test_the_error_is_in_the_document(tmp_path: Path) -> None:
    export = export_of(scene_of(Material("Tray", ({"model": "ward", "color": [0.5] * 3},))))
    write_materialx(export, tmp_path / "a.zip")
    error = export.materials[0].error
    assert f"relative error {error:.4f}" in zipfile.ZipFile(tmp_path / "a.zip").read(DOCUMENT).decode()
    assert (
        "Geometry, lights and cameras are not part of MaterialX." in export_report(export, FORMATS["materialx"]).omitted
    )


def test_a_missing_library_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    export, real_import = export_of(scene_of(Material("Wall", terms_of(PLASTIC)))), builtins.__import__

    def refuse(name: str, *arguments: Any, **more: Any) -> Any:
        if name in ("MaterialX", "pxr"):
            raise ImportError(name)
        return real_import(name, *arguments, **more)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(SceneError, match=r"MaterialX isn't installed; run pip install relume\[materialx\]"):
        write_materialx(export, tmp_path / "a.zip")
    with pytest.raises(SceneError, match=r"pip install relume\[usd\]"):
        FORMATS["usd"].write(export, tmp_path / "a.usdz")
    assert [*tmp_path.iterdir()] == []
