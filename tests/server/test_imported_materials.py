"""MaterialX documents in the library: over REST, on the command line, and in looks."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest
from fastapi.testclient import TestClient

from relume.brdf.texture_slots import IMAGES
from relume.core.errors import MaterialError
from relume.images.image_store import load_texture
from relume.imported_materials.material_store import store_materials
from relume.scene.texture_encoding import decode
from relume.scene_io.referenced_files import Folder
from relume_cli.main import main

pytest.importorskip("MaterialX", reason="pip install relume[materialx]")
URL = "/api/materials/imported"
TILED = """<?xml version="1.0"?><materialx version="1.39">
<tiledimage name="c" type="color3"><input name="file" type="filename" value="maps/c.png" colorspace="srgb_texture"/>
<input name="uvtiling" type="vector2" value="{tiling}"/></tiledimage>
<gltf_pbr name="S" type="surfaceshader"><input name="base_color" type="color3" nodename="c"/>
<input name="metallic" type="float" value="0"/><input name="emissive" type="color3" value="1, 1, 1"/></gltf_pbr>
<surfacematerial name="Tiles" type="material"><input name="surfaceshader" type="surfaceshader" nodename="S"/>
</surfacematerial></materialx>"""
GOLD = """<materialx version="1.39"><gltf_pbr name="Gold" type="surfaceshader">
<input name="base_color" type="color3" value="0.9, 0.7, 0.3"/></gltf_pbr></materialx>"""
PIXELS = np.array([[[255, 0, 0], [0, 255, 0]]], np.uint8)  # red, green


def packed(document: str) -> bytes:
    encoded, archive = io.BytesIO(), io.BytesIO()
    PIL.Image.fromarray(PIXELS).save(encoded, "PNG")
    with zipfile.ZipFile(archive, "w") as entries:
        entries.writestr("set/tiles.mtlx", document)
        entries.writestr("set/maps/c.png", encoded.getvalue())
    return archive.getvalue()


def test_rest_imports_lists_shows_and_deletes(client: TestClient) -> None:
    refused = client.post(URL, files={"material": ("a.mtlx", b"<html/>")})
    assert (refused.status_code, refused.json()["type"]) == (422, "urn:relume:problem:material")
    assert "not MaterialX" in refused.json()["detail"]
    response = client.post(URL, files={"material": ("set/tiles.zip", packed(TILED.format(tiling="2, 1")))})
    assert response.status_code == 201, response.text
    made: dict[str, Any] = response.json()
    assert response.headers["Location"] == f"{URL}/{made['id']}"
    assert made["name"] == "tiles"
    (material,) = made["materials"]
    assert material["name"] == "Tiles"
    texture = material["terms"][0]["texture"]
    assert np.array_equal(load_texture(texture).pixels, np.tile(PIXELS, (1, 2, 1)))
    assert [image["texture"] for image in client.get("/api/images").json()] == [texture]
    assert [warning["text"] for warning in made["warnings"]] == [
        "Emission of material “Tiles” isn't imported; add a mesh light to the object."
    ]
    assert client.get(URL).json() == [made] == [client.get(f"{URL}/{made['id']}").json()]
    ball = np.asarray(PIL.Image.open(io.BytesIO(client.get(material["thumbnail"]).content)), int)
    assert ball.shape == (64, 64, 3)
    assert ball[16:48, 16:48, 2].mean() < ball[16:48, 16:48, :2].mean() - 20  # no blue
    assert client.get(f"{URL}/{made['id']}/1/thumbnail.png").status_code == 404
    look = {"materials": {"Ball": {"terms": material["terms"]}}}
    assert client.put("/api/looks/tiles", json=look).status_code == 201
    assert client.delete(f"{URL}/{made['id']}").status_code == 204
    assert client.get(URL).json() == []
    assert client.get(f"{URL}/{made['id']}").status_code == 404


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not XML"),
        (b"PK\3\4", "truncated"),
        (packed("<materialx/>").replace(b".mtlx", b".text"), "0 MaterialX files; pack one of .mtlx"),
    ],
)
def test_unusable_files_are_refused(tmp_path: Path, data: bytes, message: str) -> None:
    (tmp_path / "a.zip").write_bytes(data)
    with pytest.raises(MaterialError, match=message):
        store_materials(tmp_path / "made", tmp_path / "images", tmp_path / "a.zip", "A")
    assert not (tmp_path / "made").exists()


def test_command_line_imports_a_document_with_the_images_of_its_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "tiles.zip").write_bytes(packed(TILED.format(tiling="1, 1")))
    (tmp_path / "gold.mtlx").write_text(GOLD)
    data = ["--data", str(tmp_path / "data")]
    assert main(["material", "import", str(tmp_path / "tiles.zip"), "--json", *data]) == 0
    tiles = json.loads(capsys.readouterr().out)
    assert [material["name"] for material in tiles["materials"]] == ["Tiles"]
    assert main(["material", "import", str(tmp_path / "gold.mtlx"), "--name", "Metals", *data]) == 0
    gold = capsys.readouterr()
    assert '"f0": [0.9, 0.7, 0.3]' in gold.err
    assert main(["list", "materials", *data]) == 0
    listed = capsys.readouterr().out
    assert f"{gold.out.strip():21}  Metals: Gold" in listed
    assert f"{tiles['id']:21}  tiles: Tiles" in listed


@pytest.mark.parametrize(("tiling", "moved"), [("2, 2", False), ("1.5, 1", True)])
def test_placements_that_no_texture_can_have_are_a_warning(tmp_path: Path, tiling: str, moved: bool) -> None:
    (tmp_path / "maps").mkdir()
    PIL.Image.fromarray(PIXELS).save(tmp_path / "maps" / "c.png")
    (tmp_path / "t.mtlx").write_text(TILED.format(tiling=tiling))
    with IMAGES.with_search_folder(tmp_path / "images") as images:
        record = store_materials(tmp_path / "made", images, tmp_path / "t.mtlx", "T", Folder(tmp_path))
        assert any("Texture coordinates of material “Tiles”" in warning for warning in record.warnings) == moved
        texture = load_texture(record.materials[0].terms[0]["texture"])
        np.testing.assert_array_equal(decode(texture.pixels[0, 0], texture.encoding), [1, 0, 0])
    again = store_materials(tmp_path / "made", tmp_path / "images", tmp_path / "t.mtlx", "U", Folder(tmp_path))
    assert (again.id, again.name) == (record.id, "U")
