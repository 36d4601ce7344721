"""Layers and images of USD scenes: found in the same folder, archive or upload, and nowhere else."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from usd_text import CHECKER, RGB, WHITE, Files, imported, painted, quad, texture, usda

from relume.core.errors import SceneError
from relume.scene.model import Scene
from relume.scene_io.import_scene import import_scene
from relume.scene_io.referenced_files import Folder, UploadedFiles
from relume.scene_io.usd import layers

pytest.importorskip("pxr.Usd")

REFERENCE = 'def Xform "Root" (\n    references = %s\n) {\n}\n'


def chair(extra: str = "") -> bytes:
    return usda(f'def Xform "Chair" {{\n{quad("Seat")}\n}}\n{extra}', 'defaultPrim = "Chair"')


def names(scene: Scene) -> list[str]:
    return [mesh.name for mesh in scene.meshes]


def usdz(files: dict[str, bytes]) -> bytes:
    """A package: uncompressed, contents at multiples of 64 bytes."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_STORED) as archive:
        for name, data in files.items():
            info = zipfile.ZipInfo(name)
            start = packed.tell() + 30 + len(name.encode()) + 4
            info.extra = b"\x86\x19" + (-start % 64).to_bytes(2, "little") + bytes(-start % 64)
            archive.writestr(info, data)
    return packed.getvalue()


def zipped(files: dict[str, bytes]) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return packed.getvalue()


@pytest.mark.parametrize(
    "arc",
    [
        "references = @./parts/chair.usda@",
        "payload = @parts/chair.usda@",
        "references = @parts\\chair.usda@",
        "references = @PARTS/Chair.usda@",
        "references = @C:/Users/me/parts/chair.usda@",
        "references = @parts/chair.usda:SDF_FORMAT_ARGS:a=b@",
    ],
)
def test_references_and_payloads_are_read_next_to_the_scene(arc: str, tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "chair.usda").write_bytes(chair())
    (tmp_path / "chair.usda").write_bytes(chair())
    (tmp_path / "scene.usda").write_bytes(usda(f'def Xform "Root" (\n{arc}\n) {{\n}}'))
    assert names(import_scene(tmp_path / "scene.usda", "test", WHITE)) == ["Seat"]


def test_sublayers_and_layers_of_layers_are_relative_to_their_own_folder() -> None:
    files = {
        "layers/look.usda": usda(painted(RGB, texture("Image", "../maps/checker.png"))),
        "maps/checker.png": CHECKER,
    }
    scene = imported(usda("", "subLayers = [@layers/look.usda@]"), Files(files))
    assert "diffuse" in scene.materials[0].textures
    assert scene.warnings == ()


def test_layers_that_name_one_another_are_read_once() -> None:
    other = usda(REFERENCE % "@scene.usda@</Seat>" + quad("Other"))
    scene = imported(
        usda(quad("Seat"), "subLayers = [@other.usda@]"), Files({"other.usda": other, "scene.usda": usda(quad("Seat"))})
    )
    assert sorted(names(scene)) == ["Other", "Seat"]


@pytest.mark.parametrize("path", ["/etc/hostname.usda", "../secret.usda", "../../secret.usda", "a/../../secret.usda"])
def test_layers_outside_the_folder_are_not_read(path: str, tmp_path: Path) -> None:
    (tmp_path / "secret.usda").write_bytes(chair())
    inside = tmp_path / "a" / "b"
    inside.mkdir(parents=True)
    (inside / "scene.usda").write_bytes(usda(quad() + REFERENCE % f"@{path}@"))
    scene = import_scene(inside / "scene.usda", "test", WHITE)
    assert names(scene) == ["Quad"]
    assert any("is outside the scene's folder" in warning for warning in scene.warnings)


def test_expressions_clips_and_absolute_images_open_nothing_outside(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.mkdir()
    (secret / "chair.usda").write_bytes(chair())
    (secret / "clip.1.usda").write_bytes(usda('def Mesh "Quad" {\n float3[] points.timeSamples = {1: [(9, 9, 9)]}\n}'))
    (secret / "x.png").write_bytes(CHECKER)
    clips = f"""clips = {{
        dictionary default = {{
            string templateAssetPath = "{secret}/clip.#.usda"
            double templateStartTime = 1
            double templateEndTime = 1
            double templateStride = 1
            string primPath = "/Quad"
        }}
    }}"""
    expression = REFERENCE % '@`"${WHERE}/chair.usda"`@'
    body = (
        quad(metadata=clips) + expression + painted(RGB, texture("Image", f"{secret}/x.png")).replace('"Quad"', '"P"')
    )
    metadata = f'expressionVariables = {{\n string WHERE = "{secret}"\n}}'
    folder = tmp_path / "scene"
    folder.mkdir()
    scene = imported(usda(body, metadata), Folder(folder))
    assert sorted(names(scene)) == ["P", "Quad"]
    assert all(not material.textures for material in scene.materials)
    assert float(scene.meshes[0].positions.max()) == 1


def test_the_private_folder_is_gone_after_the_import(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    imported(usda("", "subLayers = [@chair.usda@]"), Files({"chair.usda": chair()}))
    assert [*tmp_path.iterdir()] == []


def test_missing_and_damaged_layers_cost_only_themselves() -> None:
    body = quad() + REFERENCE % "[@none.usda@, @bad.usda@, @chair.usda@</Nowhere>]"
    scene = imported(usda(body), Files({"bad.usda": b"#usda 1.0\n)(", "chair.usda": chair()}))
    assert names(scene) == ["Quad"]
    assert set(scene.warnings) == {
        "Missing layer “none.usda”: import it together with the scene.",
        "Skipped the layer “bad.usda”: it is damaged.",
        "USD reports for “/Root”: “unresolved reference prim path”; that is left out.",
    }


def test_packages_show_their_first_layer_with_their_images() -> None:
    files = {
        "main.usda": usda(painted(RGB, texture("Image", "0/checker.png")), "subLayers = [@parts/other.usda@]"),
        "parts/other.usda": usda(quad("Other")),
        "0/checker.png": CHECKER,
    }
    for data in (usdz(files), zipped({"scene.usdz": usdz(files)})):
        scene = import_scene(data, "test", WHITE)
        assert sorted(names(scene)) == ["Other", "Quad"]
        assert any("diffuse" in material.textures for material in scene.materials)
        assert scene.warnings == ()


@pytest.mark.parametrize("folder", ["", "größe/"])
def test_names_in_archives_are_utf_8_where_the_archive_does_not_say_so(folder: str) -> None:
    """USD and macOS write UTF-8 names without the flag that says so."""
    files = {
        f"{folder}main.usda": usda(painted(RGB, texture("Image", "Farbmuster é.png"))),
        f"{folder}Farbmuster é.png": CHECKER,
    }
    data = bytearray(zipped(files) if folder else usdz(files))
    for signature, flags in ((b"PK\3\4", 7), (b"PK\1\2", 9)):
        position = data.find(signature)
        while position >= 0:
            data[position + flags] &= ~0x08
            position = data.find(signature, position + 4)
    scene = import_scene(bytes(data), "test", WHITE)
    assert scene.warnings == ()
    assert "diffuse" in scene.materials[0].textures


def test_packages_are_referenced_as_a_whole_or_for_one_of_their_layers() -> None:
    package = usdz({"main.usda": chair(), "other.usda": chair().replace(b"Seat", b"Back")})
    body = REFERENCE % "@chair.usdz@" + (REFERENCE % "@chair.usdz[other.usda]@").replace("Root", "Second")
    scene = imported(usda(body), Files({"chair.usdz": package}))
    assert sorted(names(scene)) == ["Back", "Seat"]


def test_archives_show_the_layer_that_no_other_names() -> None:
    files = {
        "kit/b/scene.usda": usda(REFERENCE % "@../materials/chair.usda@"),
        "kit/materials/chair.usda": chair(),
        "kit/readme.txt": b"",
    }
    assert names(import_scene(zipped(files), "test", WHITE)) == ["Seat"]
    two = {"a.usda": chair(), "b.usda": chair(), "c/d.usda": chair()}
    with pytest.raises(SceneError, match=r"2 USD scenes side by side \(a.usda, b.usda\)"):
        import_scene(zipped(two), "test", WHITE)


def test_uploads_may_name_files_above_the_scene_among_those_sent(tmp_path: Path) -> None:
    (tmp_path / "0").write_bytes(chair())
    companions = UploadedFiles({"kit/parts/chair.usda": tmp_path / "0"}, "kit/scenes/room.usda")
    assert names(imported(usda(REFERENCE % "@../parts/chair.usda@"), companions)) == ["Seat"]


def test_crates_and_text_with_a_byte_order_mark_are_read(tmp_path: Path) -> None:
    from pxr import Usd

    text = tmp_path / "chair.usda"
    text.write_bytes(chair())
    stage = Usd.Stage.Open(str(text))
    stage.GetRootLayer().Export(str(tmp_path / "crate.usdc"))
    crate = (tmp_path / "crate.usdc").read_bytes()
    assert crate.startswith(b"PXR-USDC")
    for data in (crate, b"\xef\xbb\xbf" + chair()):
        assert names(imported(data)) == ["Seat"]


def test_too_many_layers_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(layers, "MAX_LAYERS", 2)
    files = Files({name: chair() for name in ("a.usda", "b.usda")})
    with pytest.raises(SceneError, match="more than 2 layers"):
        imported(usda("", "subLayers = [@a.usda@, @b.usda@]"), files)


def test_damaged_bytes_are_an_error_that_says_so() -> None:
    random = np.random.default_rng(1).integers(0, 256, 2_000, np.uint8).tobytes()
    for data in (b"PXR-USDC" + random, b"#usda 1.0\n" + random, b"PXR-USDC", b"#usda 9.9\n"):
        with pytest.raises(SceneError, match=r"damaged|no triangles"):
            imported(data)


def test_layers_above_the_scene_are_read_within_an_archive_or_an_upload(tmp_path: Path) -> None:
    root = usda("", 'subLayers = [@../_common/chair.usda@]\ndefaultPrim = "Chair"')
    files = {"set/stages/root.usda": root, "set/_common/chair.usda": chair()}
    assert names(import_scene(zipped(files), "test", WHITE)) == ["Seat"]
    (tmp_path / "upload").write_bytes(chair())
    uploaded = UploadedFiles({"set/_common/chair.usda": tmp_path / "upload"}, "set/stages/root.usda")
    assert names(import_scene(root, "test", WHITE, uploaded)) == ["Seat"]
    above = usda(quad(), "subLayers = [@../../../secret.usda@]")
    scene = import_scene(zipped({"set/stages/root.usda": above}), "test", WHITE)
    assert any("is outside the scene's folder" in warning for warning in scene.warnings)


def test_layers_below_a_root_are_read(tmp_path: Path) -> None:
    files = {"a/root.usda": usda("", "subLayers = [@../b/look.usda@]"), "maps/checker.png": CHECKER}
    files["b/look.usda"] = usda(painted(RGB, texture("Image", "../maps/checker.png")))
    for name, data in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(data)
    scene = import_scene(tmp_path / "a" / "root.usda", "test", WHITE, Folder(tmp_path / "a", tmp_path))
    assert "diffuse" in scene.materials[0].textures
    assert scene.warnings == ()


@pytest.mark.parametrize(
    "attribute",
    [
        'token size = "x"',
        "asset size = @a.png@",
        "float[] size = [1]",
        "point3f size = (1, 2, 3)",
        'string size.timeSamples = {0: "x"}',
    ],
)
def test_attributes_of_a_wrong_type_have_the_value_of_their_schema(attribute: str) -> None:
    scene = imported(usda(f'def Cube "Box" {{\n{attribute}\n}}\n{quad()}'))
    assert sorted(names(scene)) == ["Box", "Quad"]
    (box,) = [mesh for mesh in scene.meshes if mesh.name == "Box"]
    assert float(box.positions.max()) == 1  # half of the default, 2
    (warning,) = scene.warnings
    kind = attribute.split()[0]
    assert warning == f"Ignored “size” of “Box”: it is {kind}, unlike its schema."


def test_other_precisions_and_integers_are_read() -> None:
    body = 'def Cube "A" {\nhalf size = 4\n}\ndef Cube "B" {\nint size = 4\n}'
    points = quad().replace("point3f[]", "double3[]")
    scene = imported(usda(body + points))
    assert [float(mesh.positions.max()) for mesh in scene.meshes] == [2, 2, 1]
    assert scene.warnings == ()


def test_metadata_of_a_wrong_type_have_their_default() -> None:
    scene = imported(usda(quad(), "metersPerUnit = {}"))
    assert float(scene.meshes[0].positions.max()) == pytest.approx(0.01)  # centimeters
    assert scene.warnings == ("Ignored “metersPerUnit” of the stage: it has the wrong type.",)
