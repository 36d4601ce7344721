"""Broken or malicious OBJ, MTL, PLY, STL and ZIP files are imported with warnings or rejected, and nothing hangs."""

from __future__ import annotations

import contextlib
import io
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ply_builder import binary, header, text

from relume.assets.environments.environment import Environment
from relume.core.errors import SceneError
from relume.scene.model import Scene
from relume.scene_io.import_scene import import_scene

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
OBJ = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nusemtl a\nf 1/1/1 2/1/1 3/1/1\nf -1//-1 -2 -3\n"
MTL = b"newmtl a\nKd 0.5 0.5 0.5\nKs 0.1 0.1 0.1\nNs 50\nmap_Kd wood.png\n"


def rejected(data: bytes) -> str:
    with pytest.raises(SceneError) as problem:
        import_scene(data, "test", LIGHT)
    message = str(problem.value)
    assert message.isprintable()
    assert len(message) < 400
    return message


def packed(entries: dict[str, bytes], kind: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", kind) as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
    return file.getvalue()


@pytest.mark.parametrize(
    "line",
    [
        b"v 1 2",
        b"v a b c",
        b"f 1 2",
        b"f 0 1 2",
        b"f 1 2 99",
        b"f 1 2 -99",
        b"f 1 2 99999999999999999999999999",
        b"f 1/2/3/4 2 3",
        b"f 1 2 x",
        b"f 1/1/1 2/7/1 3/1/1",
        b"f //1 //1 //1",
        b"v " + b"9" * 5_000 + b" x",
        b"vt",
        b"v nan 0 0\nf 1 2 4",
        b"v 1e300 0 0\nf 1 2 4",
    ],
)
def test_invalid_obj_lines_are_left_out_with_one_warning(line: bytes) -> None:
    plain = import_scene(OBJ, "test", LIGHT)
    scene = import_scene(OBJ + line + b"\n", "test", LIGHT)
    is_uv = b"2/7/1" in line  # a face whose UV coordinates are missing is shown
    assert len(scene.meshes[0].faces) == len(plain.meshes[0].faces) + is_uv
    (warning,) = set(scene.warnings) - set(plain.warnings)
    assert warning.severity == "unsupported"
    assert warning.isprintable()


def test_a_line_that_is_too_long_is_refused() -> None:
    assert "longer than" in rejected(OBJ + b"f " + b"1 " * 600_000 + b"\n")


def test_obj_without_faces_or_with_too_many_objects_is_refused() -> None:
    assert "no triangles" in rejected(b"v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    many = b"".join(b"o %d\nf 1 2 3\n" % i for i in range(10_001))
    assert "objects" in rejected(OBJ + many)


def test_obj_of_degenerate_faces_only_is_refused() -> None:
    assert "no triangles" in rejected(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 2\n")


def test_unused_numbers_that_are_not_finite_are_a_warning() -> None:
    scene = import_scene(OBJ.replace(b"vt 0 0", b"vt nan 0").replace(b"vn 0 0 1", b"vn inf 0 1"), "test", LIGHT)
    assert np.isfinite(scene.meshes[0].normals).all()
    assert len([warning for warning in scene.warnings if "NaN, infinite or huge" in warning]) == 2


ESCAPES = [
    "../secret.mtl",
    "/etc/passwd",
    "..\\secret.mtl",
    "C:\\secret.mtl",
    "http://127.0.0.1/m.mtl",
    "a/../../m.mtl",
]


@pytest.mark.parametrize("name", ESCAPES)
def test_no_name_leads_out_of_the_folder(name: str, tmp_path: Path) -> None:
    (tmp_path / "secret.mtl").write_bytes(MTL)
    (tmp_path / "in").mkdir()
    library, image = f"mtllib {name}\n".encode() + OBJ[13:], f"newmtl a\nmap_Kd {name}\n".encode()
    path = tmp_path / "in" / "scene.obj"
    for content in (library, OBJ):
        path.write_bytes(content)
        (tmp_path / "in" / "m.mtl").write_bytes(image)
        assert_outside(import_scene(path, "test", LIGHT), name)
    assert_outside(import_scene(packed({"scene.obj": library}), "test", LIGHT), name)
    assert_outside(import_scene(packed({"scene.obj": OBJ, "m.mtl": image}), "test", LIGHT), name)
    assert_outside(import_scene(library, "test", LIGHT), name)


def assert_outside(scene: Scene, name: str) -> None:
    """Nothing of the other folder was read, and a warning says so, or that the last part of the name was."""
    (material,) = scene.materials
    assert not material.textures
    assert len(material.terms) == 2 or material.terms[0]["color"] != [0.5] * 3
    assert any("outside the scene's folder" in warning or "next to the scene" in warning for warning in scene.warnings)


def test_no_link_leads_out_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "secret.mtl").write_bytes(MTL)
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "m.mtl").symlink_to(tmp_path / "secret.mtl")
    (tmp_path / "in" / "scene.obj").write_bytes(OBJ)
    scene = import_scene(tmp_path / "in" / "scene.obj", "test", LIGHT)
    assert any("link that leaves" in warning for warning in scene.warnings)
    assert "Ks" not in str(scene.warnings)  # of the secret


@pytest.mark.parametrize("line", [b"Kd nan 0 0", b"Kd 1 2", b"Ns -1", b"Ns many", b"Kd 1e300", b"Pr inf"])
def test_invalid_material_numbers_are_left_out_with_one_warning(line: bytes) -> None:
    plain = import_scene(packed({"a.obj": OBJ, "m.mtl": MTL}), "test", LIGHT)
    scene = import_scene(packed({"a.obj": OBJ, "m.mtl": MTL + line}), "test", LIGHT)
    assert scene.materials[0].terms == plain.materials[0].terms
    (warning,) = set(scene.warnings) - set(plain.warnings)
    assert "material file" in warning


def test_too_many_material_files_are_refused() -> None:
    assert "1,000 materials" in rejected(
        packed({"a.obj": OBJ, "m.mtl": b"".join(b"newmtl %d\n" % i for i in range(1_001))})
    )
    assert "larger than" in rejected(packed({"a.obj": OBJ, "m.mtl": b" " * (9 << 20)}))


def test_huge_images_are_refused_before_decoding() -> None:
    ihdr = b"IHDR" + struct.pack(">IIBBBBB", 100_000, 100_000, 8, 2, 0, 0, 0)
    png = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + ihdr + bytes(4)
    scene = import_scene(packed({"a.obj": OBJ, "m.mtl": MTL, "wood.png": png}), "test", LIGHT)
    assert not scene.materials[0].textures
    assert any("Skipped “wood.png”" in warning for warning in scene.warnings)


@pytest.mark.parametrize(
    "data",
    [
        b"\0\0\2" + bytes(9) + b"\xff\xff\xff\xff\x20\0" + bytes(20),
        b"\0\0\2" + bytes(9) + b"\0\x20\0\x20\x20\0" + bytes(20),
        b"BM" + bytes(100),
        b"GIF89a" + b"\xff" * 100,
        b"II*\0\x08\0\0\0" + b"\xff" * 100,
    ],
    ids=["huge", "claim", "bmp", "gif", "tiff"],
)
def test_broken_images_of_old_formats_are_left_out(data: bytes) -> None:
    scene = import_scene(packed({"a.obj": OBJ, "m.mtl": MTL, "wood.png": data}), "test", LIGHT)
    assert not scene.materials[0].textures
    assert any("Skipped “wood.png”" in warning for warning in scene.warnings)


@pytest.mark.parametrize(
    "data",
    [
        b"ply",
        b"ply\n",
        b"ply\nend_header\n",
        b"ply\nformat ascii 1.0\nend_header\n",
        b"ply\nformat utf8 1.0\nend_header\n",
        b"ply\nformat ascii 1.0\nproperty float x\nend_header\n",
        b"ply\nformat ascii 1.0\n" + b"comment x\n" * 10_000 + b"end_header\n",
        b"ply\nformat ascii 1.0\nelement vertex 1\n" + b"property char x\n" * 300 + b"end_header\n",
        b"ply\nformat ascii 1.0\nelement vertex 3\nelement vertex 3\nend_header\n",
        header("ascii", 1, 2_000_000_000).encode() + b"0 0 0\n",
        header("binary_little_endian", 1, 999_999_999_999).encode() + bytes(100),
        header("binary_little_endian", 2_000_000_000).encode() + bytes(200),
        header("ascii", 1, -1).encode(),
        header("ascii", 1, 10**30).encode(),
        text()[:-4],
        text()[:-8] + b"1 2 9\n",
        text()[:-8] + b"1 2 -1\n",
        text()[:-8] + b"1 2 1e99\n",
        text()[:-8] + b"1 2 x\n",
        text().replace(b"4 0 1", b"-4 0 1"),
        text().replace(b"4 0 1", b"nan 0 1"),
        text().replace(b"1.0 1.0 0.0", b"nan 1.0 0.0"),
        binary("<")[:-1],
        binary(">")[:-20],
        binary("<").replace(b"list uchar int", b"list float int"),
        binary("<").replace(b"list uchar int", b"list int int"),
        binary("<").replace(b"property double z", b"property double w"),
        b"ply\nformat ascii 1.0\nelement vertex 3\nproperty list uchar int x\nend_header\n1 2\n",
    ],
)
def test_invalid_ply_files_are_refused(data: bytes) -> None:
    rejected(data)


@pytest.mark.filterwarnings("default::DeprecationWarning")  # as outside of tests
@pytest.mark.parametrize("more", [b"x\n", b"1 2 3 and so on\n", b"\x00", b"0x10"])
def test_a_ply_with_text_after_its_numbers_is_refused(more: bytes) -> None:
    assert "text instead of numbers" in rejected(text() + more)


def test_invalid_archives_are_refused() -> None:
    good = packed({"a.obj": OBJ})
    for length in (2, 10, len(good) // 2, len(good) - 1):
        rejected(good[:length])
    assert "0 scene files" in rejected(packed({"a.txt": OBJ}))
    assert "2 scene files" in rejected(packed({"a.obj": OBJ, "b.ply": text()}))
    assert "entries" in rejected(packed({f"{i}.txt": b"" for i in range(1_001)}))
    assert "unsupported compression" in rejected(packed({"a.obj": OBJ}, zipfile.ZIP_LZMA))
    encrypted = bytearray(good)
    encrypted[good.index(b"PK\1\2") + 8] |= 1
    assert "password" in rejected(bytes(encrypted))
    damaged = bytearray(good)
    damaged[45] ^= 0xFF
    assert "damaged" in rejected(bytes(damaged))


def test_zip_bombs_are_refused_before_unpacking() -> None:
    data = bytearray(packed({"a.obj": b"\n" * 1_000_000}))
    offset = data.index(b"PK\1\2")
    struct.pack_into("<I", data, offset + 24, 1 << 30)  # the declared unpacked size
    assert "unpacks to more" in rejected(bytes(data))


def with_zip64_end(archive: bytes) -> bytes:
    """The archive with a ZIP64 record of the list's true length and a plain record of one short entry."""
    offset = archive.rindex(b"PK\5\6")
    num_entries, num_bytes, start = struct.unpack_from("<HII", archive, offset + 10)
    record = struct.pack("<4sQHHIIQQQQ", b"PK\6\6", 44, 45, 45, 0, 0, num_entries, num_entries, num_bytes, start)
    locator = struct.pack("<4sIQI", b"PK\6\7", 0, offset, 1)
    plain = bytearray(archive[offset:])
    struct.pack_into("<HHII", plain, 8, 1, 1, 60, start)
    return archive[:offset] + record + locator + bytes(plain)


def test_a_long_list_of_entries_is_never_read(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    archives = [packed({f"{k:05}" + "x" * 60: b"" for k in range(12_000)})]
    archives.append(with_zip64_end(archives[0]))
    num_read = 0

    class Counted(zipfile.ZipInfo):
        def __init__(self, *args: Any) -> None:
            nonlocal num_read
            num_read += 1
            super().__init__(*args)

    monkeypatch.setattr(zipfile, "ZipInfo", Counted)
    for archive in archives:
        assert "more than 1,000 entries" in rejected(archive)
    assert num_read == 0


def test_an_archive_with_zip64_records_is_read() -> None:
    import_scene(with_zip64_end(packed({"a.obj": OBJ})), "test", LIGHT)


def test_an_empty_file_is_called_empty() -> None:
    assert "empty: 0 bytes" in rejected(b"")


def test_an_archive_in_an_archive_is_not_opened() -> None:
    assert "is not .glb" in rejected(packed({"a.obj": packed({"a.obj": OBJ})}))


STL = bytes(80) + b"\1\0\0\0" + np.array([0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0], "<f4").tobytes() + b"\0\0"
FUZZED = {
    "obj": OBJ,
    "stl": STL,
    "text": text(True),
    "little": binary("<", True),
    "zip": packed({"a.obj": OBJ, "m.mtl": MTL}),
}


@pytest.mark.parametrize("kind", FUZZED)
def test_the_unchanged_mesh_files_are_valid(kind: str) -> None:
    assert len(import_scene(FUZZED[kind], "test", LIGHT).meshes) == 1


@pytest.mark.parametrize("kind", FUZZED)
@settings(max_examples=150)
@given(
    changes=st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), max_size=8), cut=st.floats(0, 1)
)
def test_any_changed_bytes_are_imported_or_refused(kind: str, changes: list[tuple[float, int]], cut: float) -> None:
    data = bytearray(FUZZED[kind])
    for offset, value in changes:
        data[int(offset * len(data))] = value
    if cut < 0.3:
        data = data[: int(cut / 0.3 * len(data))]
    with contextlib.suppress(SceneError):
        assert isinstance(import_scene(bytes(data), "test", LIGHT), Scene)


def test_real_broken_files_are_imported_or_refused(shared_data: Path) -> None:
    files = [
        p for p in sorted((shared_data / "bad-inputs" / "trimesh").rglob("*")) if p.suffix in (".obj", ".ply", ".stl")
    ]
    assert len(files) > 15
    for path in files:
        with contextlib.suppress(SceneError):
            assert import_scene(path, "test", LIGHT).meshes
