"""Pictures of BTFs against what they stand for: the small geometry itself, and all values before compression."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.figure import Figure, skipped
from bench.indirect import PASSES
from bench.mitsuba import bsdf, missing, passes_of, render
from bench.standard_error import over_passes
from relume.bake import Recipe
from relume.brdf.registry import TERMS
from relume.btf.rings import taps_numpy
from relume.btf.shelf import BtfRecord
from relume.btf.values import Values
from relume.environments.model import Environment
from relume.environments.studio import studio
from relume.look import Look, validate
from relume.memory import Memory
from relume.methods.registry import METHODS, open_bake
from relume.picture.light import light_of
from relume.project.texels import texel_rows
from relume.render.image import render_image
from relume.scene.archive import make_scene
from relume.scene.demo.still_life import look_at
from relume.scene.model import Material, Mesh, Scene
from relume.store import bake_here
from relume.synthetic.make import GEOMETRIES
from relume.synthetic.tile import levelled, repeated

_SEEN = 1.5  # periods across the picture
_REACH = 2  # periods of the geometry on each side; light from θ = 82° passes half a period of it
_EYE = (22.0, 17.0), (52.0, 200.0)  # θ and φ, degrees: as far as can be from all directions of the BTF


def against_geometry(record: BtfRecord, folder: Path, tiny: bool) -> Figure:
    """Compare a plane that is covered with a BTF of the weave with the weave, path-traced.

    Args:
        record: of the BTF. folder: for stores. tiny: whether it is a trial.
    """
    name = "btf.geometry_rmse"
    if (why := missing()) is not None:
        return skipped((name,), "%", why)[0]
    size, spp = ((16, 16), 2) if tiny else ((96, 96), 64)
    tile = GEOMETRIES["weave"]()
    errors = []
    for k, (theta, phi) in enumerate(_EYE):
        plane, real = _scenes(tile, theta, phi)
        opened, look = covered(plane, record, size, folder / f"{k}.zarr", 60 if tiny else 2000)
        ours = render_image(opened, "eye", look)[..., :3]
        theirs = traced_by_peer(real, size, spp, [tile.materials[0]], folder / f"peer{k}")
        errors.append(over_passes(ours.astype(np.float64), theirs))
    worst = max(errors, key=lambda one: one.error.value)
    context: dict[str, Any] = {
        "from": [f"θ {theta}°, φ {phi}°" for theta, phi in _EYE],
        "errors": [one.error.value for one in errors], "biases": [one.bias.value for one in errors],
        "kept_to": record.error[-1], "noise": worst.noise, "spp": PASSES * spp, "size": list(size),
    }  # fmt: skip
    return Figure(name, 100 * worst.error.value, "%", context, 100 * worst.error.standard_error)


def traced_by_peer(
    real: Scene, size: tuple[int, int], spp: int, terms: Sequence[Sequence[Mapping[str, Any]]], to: Path
) -> NDArray[np.float32]:
    """The peer's passes of the real geometry, by paths of up to seven bounces.

    Args:
        real: the scene. size: of the view. spp: of a pass. terms: of each mesh. to: a folder that is made.
    Returns:
        (passes, height, width, 3) float32
    """
    to.mkdir()
    integrator = {"type": "path", "max_depth": 8, "rr_depth": 8}
    render(real, size, {"spp": [spp], "passes": PASSES, "bsdfs": [*map(bsdf, terms)], "integrator": integrator}, to)
    return passes_of(to)


def covered(plane: Scene, record: BtfRecord, size: tuple[int, int], path: Path, lights: int) -> tuple[Any, Look]:
    """A fixed view of one material's surface, opened, and the look that covers it.

    Args:
        plane: the scene. record: of the BTF. size: of the view. path: of the store. lights: triangles of the sky.
    """
    opened = open_bake(
        bake_here(METHODS["direct"], plane, Recipe("direct", ("eye",), size, lights), path), Memory(2 << 30)
    )
    term = {**record.terms()[0], "color": [1.0, 1.0, 1.0]}
    return opened, validate({"materials": {"Cloth": {"terms": [term]}}}, opened.default_look)


def against_table(record: BtfRecord, values: Values, folder: Path, tiny: bool) -> Figure:
    """Compare the plane's view samples with sums over all values, as they were before compression.

    Each sample takes the texel that it lies in, on both sides: what is interpolated between texels is no error of ours.

    Args:
        record: of the BTF. values: of it, before. folder: for stores. tiny: whether it is a trial.
    """
    plane, _ = _scenes(GEOMETRIES["weave"](), *_EYE[0])
    size = (12, 12) if tiny else (96, 96)
    opened, look = covered(plane, record, size, folder / "table.zarr", 60 if tiny else 1000)
    view = opened.views["eye"]
    light = light_of(look, opened.material_names, has_bounces=False)
    lights, receivers = opened.arriving(view, 0, light, opened.memory)
    uv = _to_middles(receivers.uv, values.size)
    texels = TERMS["measured_btf"].settled(dict(look.materials["Cloth"].terms[0])).texels
    assert texels is not None
    flat = replace(texels, btf=replace(texels.btf, height=np.zeros((1, 1), np.float32)))
    found = texel_rows(flat, lights, replace(receivers, uv=uv), 0, len(uv))
    expected = _from_table(values, lights, receivers, uv)
    error = float(np.linalg.norm(found - expected) / np.linalg.norm(expected))
    context = {"samples": len(uv), "kept_to": record.error[-1], "ratio": record.ratio, "texels": list(values.size)}
    return Figure("btf.table_rmse", 100 * error, "%", context)


def _to_middles(uv: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    """Move places to the middles of their texels, footprints to nothing."""
    moved, (height, width) = np.array(uv), size
    for axis, count in ((0, width), (1, height)):
        moved[:, axis] = (np.floor(uv[:, axis] * count) + 0.5) / count
    moved[:, 2] = 0
    return moved


def _from_table(values: Values, lights: Any, receivers: Any, uv: NDArray[np.float32]) -> NDArray[np.float64]:
    """Sum all values over the lights that samples see, in plain NumPy."""
    height, width = values.size
    texel = (np.floor(uv[:, 1] * height) % height * width + np.floor(uv[:, 0] * width) % width).astype(int)
    n, t = (np.asarray(a, np.float64) for a in (receivers.normal, receivers.tangent))
    b, turn = np.cross(n, t), uv[:, 3].astype(np.float64)
    x = np.cos(turn)[:, None] * t + np.sin(turn)[:, None] * b
    y = uv[:, 4, None] * (np.cos(turn)[:, None] * b - np.sin(turn)[:, None] * t)
    seen = np.unpackbits(receivers.visible, axis=1, count=lights.num_lights, bitorder="little").astype(bool)
    arriving = np.zeros((len(uv), values.rings.num_directions, 3))
    for p in range(len(uv)):
        chosen = seen[p] & (lights.direction @ n[p] > 0)
        local = lights.direction[chosen] @ np.stack([x[p], y[p], n[p]], axis=1)
        index, weight, left = taps_numpy(values.rings, local)
        power = left[:, None, None] * weight[..., None] * lights.irradiance[chosen][:, None]
        np.add.at(arriving[p], index, power)
    wo = np.asarray(receivers.wo, np.float64)
    local = np.stack([(wo * axis).sum(axis=1) for axis in (x, y, n)], axis=1)
    view, of_view, _ = taps_numpy(values.rings, local)
    out = np.zeros((len(uv), 3))
    for one in np.unique(view):
        table = values.seen_from(int(one)).astype(np.float64)  # (lights, texels, 3)
        for p, tap in zip(*np.nonzero(view == one), strict=True):
            out[p] += of_view[p, tap] * (table[:, texel[p]] * arriving[p]).sum(axis=0)
    return out


def _scenes(tile: Any, theta: float, phi: float) -> tuple[Scene, Scene]:
    """A plane to be covered, and the geometry itself, both y-up, seen from far away."""
    t, p = np.radians([theta, phi])
    towards = np.array([np.sin(t) * np.cos(p), np.cos(t), -np.sin(t) * np.sin(p)])
    far = 60.0
    camera = look_at("eye", tuple(far * towards), (0.0, 0.0, 0.0), 2 * float(np.arctan(0.5 * _SEEN / far)))
    radiance = np.array(studio().radiance)
    radiance[len(radiance) // 2 :] = 0  # a BTF knows no light from below, which holes of the geometry would let through
    sky = Environment("sky", radiance)
    material = (Material("Cloth", tile.materials[0]),)
    return tuple(  # type: ignore[return-value]
        make_scene(name, [mesh], material, [camera], sky)
        for name, mesh in (("plane", _plane()), ("geometry", _real(tile)))
    )


def _plane() -> Mesh:
    """Texture coordinates are metres: u along x, v along z."""
    half = float(_REACH)
    places = np.array([[-half, 0, half], [half, 0, half], [half, 0, -half], [-half, 0, -half]], np.float32)
    return _mesh(places, np.tile([0.0, 1, 0], (4, 1)), np.array([[0, 1, 2], [0, 2, 3]]), places[:, [0, 2]])


def _real(tile: Any) -> Mesh:
    around = repeated(levelled(tile), _REACH)
    turned = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # the texture's (x, y, z) to (x, z, −y)
    return _mesh(around.positions @ turned.T, around.normals @ turned.T, around.faces, None)


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
