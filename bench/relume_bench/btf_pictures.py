"""Compare images of BTFs with the small geometry itself, and with all uncompressed values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.btf.btf_store import BtfRecord
from relume.assets.btf.direction_rings import interpolation_weights_numpy
from relume.assets.btf.value_cache import ValueFile
from relume.assets.environments.environment import Environment
from relume.assets.environments.studio import studio
from relume.brdf.registry import TERMS
from relume.core.cache import Cache
from relume.live.fixed_camera.illumination import illumination_from_look
from relume.live.opened.openers import open_bake
from relume.look import Look, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.examples.still_life.still_life import look_at
from relume.scene.model import Camera, Material, Mesh, Scene
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume.synthetic_btf.synthesize import GEOMETRIES
from relume.synthetic_btf.tileable_geometry import centered_height, repeat_tile
from relume.transport.btf_kernel import texel_rows
from relume_bench.figure import Figure, skipped
from relume_bench.indirect import PASSES
from relume_bench.mitsuba import bsdf, missing, read_passes, render
from relume_bench.standard_error import compare_with_passes

_NUM_VISIBLE_PERIODS = 1.5  # periods across the image
_FAR = 60.0  # camera distance, periods
_REACH = 2  # periods of the geometry on each side; light from θ = 82° crosses half a period of it
_CAMERA_ANGLES = (22.0, 17.0), (52.0, 200.0)  # θ and φ, degrees: as far as possible from all directions of the BTF


def against_geometry(record: BtfRecord, folder: Path, tiny: bool) -> Figure:
    """Compare a plane covered with a BTF of the weave with the path-traced weave.

    Args:
        record: record of the BTF. folder: for stores. tiny: a trial run.
    """
    name = "btf.geometry_rmse"
    if (why := missing()) is not None:
        return skipped((name,), "%", why)[0]
    size, spp = ((16, 16), 2) if tiny else ((96, 96), 64)
    tile = GEOMETRIES["weave"]()
    errors = []
    for k, (theta, phi) in enumerate(_CAMERA_ANGLES):
        plane, displaced_scene = make_scenes(tile, studio(), [(theta, phi)])
        bake, look = bake_with_btf(plane, record, size, folder / f"{k}.zarr", 60 if tiny else 2000)
        rendered = render_image(bake, "camera", look)[..., :3]
        reference_passes = traced_by_peer(displaced_scene, size, spp, [tile.materials[0]], folder / f"peer{k}")
        errors.append(compare_with_passes(rendered.astype(np.float64), reference_passes))
    worst = max(errors, key=lambda comparison: comparison.error.value)
    context: dict[str, Any] = {
        "from": [f"θ {theta}°, φ {phi}°" for theta, phi in _CAMERA_ANGLES],
        "errors": [comparison.error.value for comparison in errors],
        "biases": [comparison.bias.value for comparison in errors],
        "compression_error": record.error[-1], "noise": worst.noise, "spp": PASSES * spp, "size": list(size),
    }  # fmt: skip
    return Figure(name, 100 * worst.error.value, "%", context, 100 * worst.error.standard_error)


def traced_by_peer(
    displaced_scene: Scene, size: tuple[int, int], spp: int, terms: Sequence[Sequence[Mapping[str, Any]]], to: Path
) -> NDArray[np.float32]:
    """Render the actual geometry with the peer, with paths of up to seven bounces.

    Args:
        displaced_scene: the scene. size: size of the view. spp: per pass. terms: terms of each mesh.
        to: folder to create.
    Returns:
        (passes, height, width, 3) float32
    """
    to.mkdir()
    integrator = {"type": "path", "max_depth": 8, "rr_depth": 8}
    render(
        displaced_scene,
        size,
        {"spp": [spp], "passes": PASSES, "bsdfs": [*map(bsdf, terms)], "integrator": integrator},
        to,
    )
    return read_passes(to)


def bake_with_btf(plane: Scene, record: BtfRecord, size: tuple[int, int], path: Path, lights: int) -> tuple[Any, Look]:
    """Bake and open a fixed view of one material's surface, with the look that covers it.

    Args:
        plane: the scene. record: record of the BTF. size: size of the view. path: path of the store.
        lights: environment triangles.
    """
    bake = open_bake(
        bake_in_process(METHODS["direct"], plane, Recipe("direct", ("camera",), size, lights), path), Cache(2 << 30)
    )
    term = {**record.terms()[0], "color": [1.0, 1.0, 1.0]}
    return bake, validate({"materials": {"Cloth": {"terms": [term]}}}, bake.default_look)


def against_table(record: BtfRecord, values: ValueFile, folder: Path, tiny: bool) -> Figure:
    """Compare the plane's view samples with sums over all uncompressed values.

    Each sample uses the texel that contains it, on both sides, which excludes the error of interpolation.

    Args:
        record: record of the BTF. values: uncompressed. folder: for stores. tiny: a trial run.
    """
    plane, _ = make_scenes(GEOMETRIES["weave"](), studio(), _CAMERA_ANGLES[:1])
    size = (12, 12) if tiny else (96, 96)
    bake, look = bake_with_btf(plane, record, size, folder / "table.zarr", 60 if tiny else 1000)
    view = bake.views["camera"]
    light = illumination_from_look(look, bake.material_names, has_bounces=False)
    lights, receivers = bake.incident_light(bake.samples(view, 0, bake.cache), light)
    uv = _to_middles(receivers.uv, values.size)
    texels = TERMS["measured_btf"].normalized(dict(look.materials["Cloth"].terms[0])).texels
    assert texels is not None
    flat = replace(texels, btf=replace(texels.btf, height=np.zeros((1, 1), np.float32)))
    radiance = texel_rows(flat, lights, replace(receivers, uv=uv), 0, len(uv))
    expected = _from_table(values, lights, receivers, uv)
    error = float(np.linalg.norm(radiance - expected) / np.linalg.norm(expected))
    context = {
        "samples": len(uv),
        "compression_error": record.error[-1],
        "ratio": record.ratio,
        "texels": list(values.size),
    }
    return Figure("btf.table_rmse", 100 * error, "%", context)


def _to_middles(uv: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    """Move UV coordinates to the centers of their texels, and footprints to zero."""
    moved, (height, width) = np.array(uv), size
    for axis, count in ((0, width), (1, height)):
        moved[:, axis] = (np.floor(uv[:, axis] * count) + 0.5) / count
    moved[:, 2] = 0
    return moved


def _from_table(values: ValueFile, lights: Any, receivers: Any, uv: NDArray[np.float32]) -> NDArray[np.float64]:
    """Sum all values over the lights visible to the samples, in plain NumPy."""
    height, width = values.size
    texel = (np.floor(uv[:, 1] * height) % height * width + np.floor(uv[:, 0] * width) % width).astype(int)
    n, t = (np.asarray(a, np.float64) for a in (receivers.normal, receivers.tangent))
    b, rotation = np.cross(n, t), uv[:, 3].astype(np.float64)
    x = np.cos(rotation)[:, None] * t + np.sin(rotation)[:, None] * b
    y = uv[:, 4, None] * (np.cos(rotation)[:, None] * b - np.sin(rotation)[:, None] * t)
    visible = np.unpackbits(receivers.visible, axis=1, count=lights.num_lights, bitorder="little").astype(bool)
    incident = np.zeros((len(uv), values.grid.num_directions, 3))
    for p in range(len(uv)):
        is_lit = visible[p] & (lights.direction @ n[p] > 0)
        local = lights.direction[is_lit] @ np.stack([x[p], y[p], n[p]], axis=1)
        index, weight, residual = interpolation_weights_numpy(values.grid, local)
        power = residual[:, None, None] * weight[..., None] * lights.irradiance[is_lit][:, None]
        np.add.at(incident[p], index, power)
    wo = np.asarray(receivers.wo, np.float64)
    local = np.stack([(wo * axis).sum(axis=1) for axis in (x, y, n)], axis=1)
    view, view_weights, _ = interpolation_weights_numpy(values.grid, local)
    out = np.zeros((len(uv), 3))
    for view_index in np.unique(view):
        table = values.get_view(int(view_index)).astype(np.float64)  # (lights, texels, 3)
        for p, tap in zip(*np.nonzero(view == view_index), strict=True):
            out[p] += view_weights[p, tap] * (table[:, texel[p]] * incident[p]).sum(axis=0)
    return out


def make_scenes(tile: Any, dome: Environment, angles: Sequence[tuple[float, float]]) -> tuple[Scene, Scene]:
    """A plane to cover, and the actual geometry, both Y up, viewed from far away by a camera for each θ and φ.

    Args:
        tile: one period. dome: its upper half lights both; the BTF has no light from below, which gaps of the geometry
            would let through. angles: of the cameras, degrees.
    """
    radiance = np.array(dome.radiance)
    radiance[len(radiance) // 2 :] = 0
    environment, material = Environment("sky", radiance), (Material("Cloth", tile.materials[0]),)
    cameras = [_far_camera(f"camera{number or ''}", *pair) for number, pair in enumerate(angles)]
    return tuple(  # type: ignore[return-value]
        make_scene(name, [mesh], material, cameras, environment)
        for name, mesh in (("plane", _plane()), ("geometry", _make_displaced_geometry(tile)))
    )


def _far_camera(name: str, theta: float, phi: float) -> Camera:
    """A camera towards the origin. theta, phi: degrees."""
    t, p = np.radians([theta, phi])
    position = _FAR * np.array([np.sin(t) * np.cos(p), np.cos(t), -np.sin(t) * np.sin(p)])
    return look_at(name, tuple(position), (0.0, 0.0, 0.0), 2 * float(np.arctan(0.5 * _NUM_VISIBLE_PERIODS / _FAR)))


def _plane() -> Mesh:
    """A plane whose texture coordinates are meters: u along x, v along z."""
    half = float(_REACH)
    corners = np.array([[-half, 0, half], [half, 0, half], [half, 0, -half], [-half, 0, -half]], np.float32)
    return _mesh(corners, np.tile([0.0, 1, 0], (4, 1)), np.array([[0, 1, 2], [0, 2, 3]]), corners[:, [0, 2]])


def _make_displaced_geometry(tile: Any) -> Mesh:
    repeated_tile = repeat_tile(centered_height(tile), _REACH)
    axis_rotation = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # the texture's (x, y, z) to (x, z, −y)
    return _mesh(
        repeated_tile.positions @ axis_rotation.T, repeated_tile.normals @ axis_rotation.T, repeated_tile.faces, None
    )


def _mesh(positions: Any, normals: Any, faces: Any, uvs: Any) -> Mesh:
    count = len(positions)
    return Mesh(
        "cloth",
        np.ascontiguousarray(positions, np.float32),
        np.ascontiguousarray(normals, np.float32),
        np.tile(np.array([1, 0, 0, 1], np.float32), (count, 1)),
        np.zeros((count, 2), np.float32) if uvs is None else np.ascontiguousarray(uvs, np.float32),
        np.ascontiguousarray(faces, np.uint32),
        0,
    )
