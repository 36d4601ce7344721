"""Transformed texture coordinates in exports, read again: the same coordinates as in the look."""

from pathlib import Path

import numpy as np
import pytest
from export_scenes import PLASTIC, checker, export_of, scene_of, srgb_texture, terms_of

from relume.core.errors import ParameterError
from relume.export.export_scene import FORMATS
from relume.look.model import UvLook
from relume.math.uv_transform import UvTransform
from relume.scene.model import Material, Opacity, Scene, Texture, TextureEncoding
from relume.scene.texture_encoding import decode
from relume.scene_io.import_scene import import_scene
from relume.scene_io.materialx.import_document import import_materialx
from relume.scene_io.surfaces.to_terms import PbrSurface
from relume.scene_io.zip_scene import open_zip

UV = {"scale": [2.0, -1.5], "rotation": 30.0, "offset": [0.2, -0.4]}
TRANSFORM = UvTransform((0.2, -0.4), float(np.radians(30)), (2.0, -1.5))
LOOK = {"materials": {"Cloth": {"uv": UV}}}


def textured() -> Scene:
    textures = {"diffuse": srgb_texture(checker([[255, 0, 0], [0, 200, 40]]))}
    normals = Texture(checker([[128, 128, 255], [190, 100, 230]]), encoding=TextureEncoding("normal"))
    surface = PbrSurface(
        PLASTIC.diffuse, PLASTIC.f0, 1.0, 0.4, PLASTIC.specular_reflectance, textures, has_normal_map=True
    )
    return scene_of(Material("Cloth", terms_of(surface), textures, normals))


@pytest.mark.parametrize("file_format", ["glb", "usd"])
def test_coordinates_are_read_again(tmp_path: Path, file_format: str) -> None:
    """As imports do, they are part of the meshes; normals have the frame of the meshes' tangents."""
    scene, path = textured(), tmp_path / f"a{FORMATS[file_format].suffix}"
    FORMATS[file_format].write(export_of(scene, LOOK), path)
    again = import_scene(path, "again")
    order = [int(np.abs(scene.meshes[0].positions - p).sum(axis=1).argmin()) for p in again.meshes[0].positions]
    np.testing.assert_allclose(again.meshes[0].uvs, TRANSFORM.points(scene.meshes[0].uvs)[order], atol=1e-5)
    (own, read) = (each.materials[0].normal_map for each in (scene, again))
    assert own is not None
    assert read is not None
    expected = TRANSFORM.normals(decode(own.pixels, own.encoding))
    if file_format == "glb":
        np.testing.assert_allclose(decode(read.pixels, read.encoding), expected, atol=0.02)


def test_materialx_has_a_node_for_them(tmp_path: Path) -> None:
    pytest.importorskip("MaterialX", reason="needs the package materialx")
    FORMATS["materialx"].write(export_of(textured(), LOOK), tmp_path / "a.zip")
    (read,) = import_materialx(*open_zip((tmp_path / "a.zip").read_bytes(), (".mtlx",), "MaterialX")).materials
    np.testing.assert_allclose(read.uv_slot.transform.matrix, TRANSFORM.matrix, atol=1e-5)
    np.testing.assert_allclose(read.uv_slot.transform.offset, TRANSFORM.offset, atol=1e-5)


def test_the_identity_writes_nothing(tmp_path: Path) -> None:
    for document in ({}, {"materials": {"Cloth": {"uv": UvLook().model_dump()}}}):
        FORMATS["glb"].write(export_of(textured(), document), tmp_path / "a.glb")
        assert b"KHR_texture_transform" not in (tmp_path / "a.glb").read_bytes()


def test_opacity_images_cannot_be_transformed() -> None:
    leaf = scene_of(Material("Leaf", terms_of(PLASTIC), opacity=Opacity(checker([255, 0]), cutoff=0.5)))
    with pytest.raises(ParameterError, match=r"/materials/Leaf/uv.*null, since this material has an opacity image"):
        export_of(leaf, {"materials": {"Leaf": {"uv": UV}}})
