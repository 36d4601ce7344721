"""AOVs and Cryptomattes, read back by OpenImageIO, against values known in closed form and counts of single rays."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import OpenImageIO
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tiny_scenes import make_camera, quad, still_life

from relume.look import default_look, validate
from relume.output.exr.aovs import SAMPLES, AovTracer
from relume.output.exr.cryptomatte import RANKS, id_of, murmur3_32, ranked_coverage
from relume.output.exr.export import AovPass, export_exr
from relume.raytrace.camera_rays import camera_directions, trace_rays
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.scene.model import Glass, Material, Opacity, Texture
from relume.scene.scene_folder import make_scene
from relume_server.jobs import render_jobs

SIZE = (48, 32)
WHITE = {"model": "lambert", "color": [1, 1, 1]}


def lambert(name, color, **more):
    return Material(name, ({**WHITE, "color": list(color)},), **more)


def square(name, z, material, half=1.0, x=0.0):
    corners = [[x - half, -half, z], [x + half, -half, z], [x + half, half, z], [x - half, half, z]]
    return quad(name, corners, material)


def scene_of(meshes, materials):
    scene = still_life()
    camera = make_camera("front", [0, 0, 4], [0, 0, 0], np.radians(40))
    return replace(
        make_scene("aovs", tuple(meshes), tuple(materials), (camera,), scene.environment), offset=(10.0, 0.0, 0.0)
    )


def written(scene, path, size=SIZE, **look):
    """Channels by name, and the attributes, of a file with AOVs."""
    complete = validate(look, default_look(scene.materials, scene.lights))
    aovs = AovPass(AovTracer.from_look(scene, complete), scene.cameras[0], size)
    image = np.zeros((size[1], size[0], 3), np.float32)
    export_exr(path, lambda look, progress: image, complete, [], {}, aovs=aovs)
    buffer = OpenImageIO.ImageBuf(str(path))
    spec = buffer.spec()
    values = dict(zip(spec.channelnames, np.moveaxis(buffer.get_pixels(OpenImageIO.FLOAT), 2, 0), strict=True))
    return values, {attribute.name: attribute.value for attribute in spec.extra_attribs}, spec


def vector(values, layer, names="XYZ"):
    return np.stack([values[f"{layer}.{name}"] for name in names], axis=-1)


def test_values_of_a_plane_are_those_in_closed_form(tmp_path):
    lights = {"Glow": {"kind": "mesh", "material": "red", "emission": [2, 0, 1]}}
    scene = scene_of([square("wall", 0, 0)], [lambert("red", (0.5, 0.25, 0.125), double_sided=False)])
    values, attributes, spec = written(scene, tmp_path / "a.exr", lights=lights)
    center = 16, 24
    ray = camera_directions(scene.cameras[0], SIZE, np.array([24.5], np.float32), np.array([16.5], np.float32))[0]
    assert values["Z"][center] == pytest.approx(4, rel=1e-6)
    np.testing.assert_allclose(vector(values, "P")[center], [0, 0, 4] - 4 * ray / ray[2], atol=0.01)
    np.testing.assert_allclose(vector(values, "N")[center], [0, 0, 1], atol=1e-6)
    np.testing.assert_allclose(vector(values, "albedo", "RGB")[center], [0.5, 0.25, 0.125], rtol=2e-3)
    np.testing.assert_allclose(vector(values, "emission", "RGB")[center], [2, 0, 1])
    x, y, _ = vector(values, "P")[center]
    assert values["UV.U"][center] == pytest.approx((x + 1) / 2, abs=1e-5)
    assert values["UV.V"][center] == pytest.approx((y + 1) / 2, abs=1e-5)
    assert np.isinf(values["Z"][0, 0])
    assert vector(values, "N")[0, 0].tolist() == [0, 0, 0]
    assert json.loads(attributes["relume:offset"]) == [10, 0, 0]
    halves = {name for name, kind in zip(spec.channelnames, spec.channelformats, strict=True) if str(kind) == "half"}
    assert halves == {"R", "G", "B"}


def test_emission_is_of_the_front_of_single_sided_surfaces(tmp_path):
    lights = {"Glow": {"kind": "mesh", "material": "red", "emission": [2, 0, 1]}}
    wall = square("wall", 0, 0)
    back = replace(wall, faces=wall.faces[:, ::-1], normals=-wall.normals)
    for double_sided, expected in ((False, 0), (True, 2)):
        material = lambert("red", (0.5, 0.25, 0.125), double_sided=double_sided)
        values, _, _ = written(scene_of([back], [material]), tmp_path / "a.exr", lights=lights)
        assert values["emission.R"][16, 24] == expected


def test_albedo_has_the_textures_of_the_look(tmp_path):
    pixels = np.zeros((1, 2, 3), np.float32)
    pixels[0] = [[1, 0.5, 0], [0.25, 0.5, 1]]
    terms = ({**WHITE, "color": [0.8, 0.8, 0.8], "texture": "diffuse"},)
    material = Material("m", terms, {"diffuse": Texture(pixels, ("clamp", "clamp"))})
    values, _, _ = written(scene_of([square("wall", 0, 0)], [material]), tmp_path / "a.exr")
    albedo = vector(values, "albedo", "RGB")[16, [16, 31]]
    np.testing.assert_allclose(albedo, 0.8 * pixels[0], atol=0.01)


PUBLISHED = {
    "": 0,
    "hello": 0x248BFA47,
    "hello, world": 0x149BBB7F,
    "The quick brown fox jumps over the lazy dog": 0x2E4FF723,
}


def test_hash_is_that_of_the_published_vectors():
    assert {text: murmur3_32(text.encode()) for text in PUBLISHED} == PUBLISHED


@given(st.text())
def test_ids_are_bits_of_normal_floats(name):
    value = np.array(id_of(name)).view(np.float32)
    assert np.isfinite(value)
    assert abs(value) >= np.finfo(np.float32).tiny


@given(st.lists(st.lists(st.integers(0, 9), min_size=SAMPLES, max_size=SAMPLES), min_size=1, max_size=20))
def test_ranks_are_the_most_frequent_ids(rows):
    ids, coverage = ranked_coverage(np.array(rows, np.uint32))
    for row, row_ids, row_coverage in zip(rows, ids, coverage, strict=True):
        counts = {value: row.count(value) for value in sorted(set(row)) if value}
        expected = sorted(counts.items(), key=lambda item: -item[1])[:RANKS]
        found = [(int(i), round(float(c) * SAMPLES)) for i, c in zip(row_ids, row_coverage, strict=True) if c]
        assert found == expected


def test_coverage_is_that_of_single_rays_and_ids_decode_to_names(tmp_path):
    """Against 32 × 32 rays of each pixel, the ids of which are counted one by one."""
    names = ["", "a/b", 'the "cup"', "cup ☕", "left", "left"]
    meshes = [square(name, -0.3 * k, k % 3, 0.5, 0.4 * k - 1) for k, name in enumerate(names)]
    scene = scene_of(meshes, [lambert(name, (0.5, 0.5, 0.5)) for name in ("paint", "métal", "x" * 300)])
    values, attributes, _ = written(scene, tmp_path / "a.exr")
    geometry, side = build_scene_buffers(scene), 32
    y, x = np.divmod(np.arange(SIZE[0] * side * SIZE[1] * side), SIZE[0] * side)
    directions = camera_directions(
        scene.cameras[0], SIZE, ((x + 0.5) / side).astype(np.float32), ((y + 0.5) / side).astype(np.float32)
    )
    face = trace_rays(geometry.embree, np.array([0, 0, 4], np.float32), directions).face
    for layer, index_of, all_names in (
        ("CryptoObject", geometry.face_mesh, names),
        ("CryptoMaterial", geometry.face_material, [material.name for material in scene.materials]),
    ):
        manifest = manifest_of(attributes, layer)
        assert manifest == {name: f"{int(id_of(name)):08x}" for name in all_names}
        for name, text in manifest.items():
            indices = [k for k, each in enumerate(all_names) if each == name]
            is_in = np.isin(index_of[np.maximum(face, 0)], indices) & (face >= 0)
            expected = is_in.reshape(SIZE[1], side, SIZE[0], side).mean(axis=(1, 3))
            decoded = coverage_of(values, layer, int(text, 16))
            assert np.abs(decoded - expected).max() <= 2 / SAMPLES  # edges: as fine as the rays of a pixel
            assert np.abs((decoded - expected).mean()) < 1e-3
            inside = (expected == 0) | (expected == 1)
            np.testing.assert_array_equal(decoded[inside], expected[inside])


def manifest_of(attributes, layer):
    """Manifest of a layer, found as readers do: by the name in the metadata."""
    (prefix,) = (
        name.removesuffix("/name") for name, value in attributes.items() if name.endswith("/name") and value == layer
    )
    assert prefix == f"cryptomatte/{murmur3_32(layer.encode()):08x}"[:19]
    assert attributes[f"{prefix}/hash"] == "MurmurHash3_32"
    assert attributes[f"{prefix}/conversion"] == "uint32_to_float32"
    return json.loads(attributes[f"{prefix}/manifest"])


def coverage_of(values, layer, wanted):
    """Coverage of an id, summed over all ranks."""
    total = np.zeros(values["Z"].shape)
    for rank in range(RANKS):
        identity, coverage = ("RB"[rank % 2], "GA"[rank % 2])
        bits = np.ascontiguousarray(values[f"{layer}{rank // 2:02d}.{identity}"]).view(np.uint32)
        total += np.where(bits == wanted, values[f"{layer}{rank // 2:02d}.{coverage}"], 0)
    return total


def test_rays_pass_holes_stop_at_glass_and_count_blended_surfaces_by_opacity(tmp_path):
    holes, half = np.array([[0, 255]], np.uint8), np.full((1, 1), 128, np.uint8)
    clamp = ("clamp", "clamp")
    front = {
        "cut": lambert("front", (1, 1, 1), opacity=Opacity(holes, clamp, 0.5)),
        "blend": lambert("front", (1, 1, 1), opacity=Opacity(half, clamp)),
        "glass": lambert("front", (1, 1, 1), glass=Glass((1.0, 1.0, 1.0), 1.5)),
    }
    covered = {}
    for kind, material in front.items():
        scene = scene_of([square("front", 0.5, 0), square("back", 0, 1, 2)], [material, lambert("back", (1, 1, 1))])
        values, _, _ = written(scene, tmp_path / "a.exr")
        covered[kind] = coverage_of(values, "CryptoObject", int(id_of("front")))
    assert covered["cut"][16, [18, 30]].tolist() == [0, 1]
    assert covered["glass"][16, [18, 30]].tolist() == [1, 1]
    assert covered["blend"][12:20, 18:30].mean() == pytest.approx(0.5, abs=1 / SAMPLES)


def test_planned_size_counts_all_channels(tmp_path):
    values, _, _ = written(scene_of([square("wall", 0, 0)], [lambert("red", (1, 0, 0))]), tmp_path / "a.exr")
    assert 4 * (len(values) - 3) == render_jobs._AOV_BYTES


def test_bands_make_the_same_channels(monkeypatch, tmp_path):
    scene = still_life()
    whole, _, _ = written(scene, tmp_path / "a.exr", (40, 30))
    monkeypatch.setattr("relume.output.exr.aovs._MAX_RAYS", 7 * SAMPLES * 40)
    bands, _, _ = written(scene, tmp_path / "b.exr", (40, 30))
    for name, values in whole.items():
        np.testing.assert_array_equal(bands[name], values, err_msg=name)
