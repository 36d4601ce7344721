"""btf.*: how well BTFs are kept, and how near they are to what they stand for.

`btf.compression_error`: relative RMS of all values, of what is kept as it is rounded, where it is a fiftieth of a byte
for each channel of each image; the worst of the three synthetic BTFs, between the bounds that were measured. `ratio`
and `error` of the context are the curve. The norm: √Σ(kept − made)² ÷ √Σ made²; `of_range` divides by √mean square of
the brightest thousandth instead, as errors of 8-bit images are often told. `btf.compression_ratio`: at an error of 5 %.

`btf.geometry_rmse`: a plane that is covered with the woven BTF, under a sky, against Mitsuba's paths through the real
small geometry on the same place, seen from between the directions that the BTF was made for. Its noise is taken off.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from bench.figure import Figure, skipped
from bench.indirect import PASSES
from bench.mitsuba import bsdf, missing, render
from bench.standard_error import over_passes
from relume.bake import Recipe
from relume.btf.compress import compress
from relume.btf.rings import ubo_rings
from relume.btf.shelf import STORE, keep
from relume.btf.values import Values
from relume.environments.model import Environment
from relume.environments.studio import studio
from relume.look import validate
from relume.memory import Memory
from relume.methods.registry import METHODS, open_bake
from relume.render.image import render_image
from relume.scene.archive import make_scene
from relume.scene.demo.still_life import look_at
from relume.scene.model import Material, Mesh, Scene
from relume.store import bake_here
from relume.synthetic.make import GEOMETRIES
from relume.synthetic.render import SmallGeometry
from relume.synthetic.tile import levelled, repeated

_BOUNDS = (0.04, 0.08, 0.16)
_AT_RATIO, _AT_ERROR = 50.0, 0.05
_SEEN = 1.5  # periods across the picture
_REACH = 5  # periods of the geometry on each side
_EYE = (22.0, 17.0), (52.0, 200.0)  # θ and φ, degrees: as far as can be from all directions of the BTF


def measure(tiny: bool) -> list[Figure]:
    """Make the three, compress each for some bounds, and compare the first with its geometry."""
    size, grid = (8, 1) if tiny else (64, 2)
    with tempfile.TemporaryDirectory() as folder:
        curves = {}
        for name, geometry in GEOMETRIES.items():
            values = Values(Path(folder) / name, ubo_rings(), (size, size))
            small = SmallGeometry(geometry(), ubo_rings(), (size, size), grid, 1)
            values.fill(small.seen_from, lambda share: None, lambda: False)
            curves[name] = _curve(values, _BOUNDS[:2] if tiny else _BOUNDS)
        context = {"texels": f"{size}×{size}", "places_a_texel": grid**2, "curves": curves}
        error = max(_between(curve["ratio"], curve["error"], _AT_RATIO) for curve in curves.values())
        ratio = min(_between(curve["error"], curve["ratio"], _AT_ERROR) for curve in curves.values())
        return [
            Figure("btf.compression_error", 100 * error, "%", context),
            Figure("btf.compression_ratio", ratio, "× smaller", context),
            _geometry(Values(Path(folder) / "weave", ubo_rings(), (size, size)), Path(folder), tiny),
        ]


def _curve(values: Values, bounds: tuple[float, ...]) -> dict[str, list[float]]:
    """Ratios and errors for some bounds."""
    found = [compress(values, bound, lambda share: None, lambda: False) for bound in bounds]
    sample = np.concatenate([values.seen_from(view).ravel()[::7] for view in range(0, 81, 8)]).astype(np.float64)
    brightest = np.sort(sample)[-max(1, len(sample) // 1000) :]
    to_range = float(np.sqrt(np.mean(sample**2)) / np.sqrt(np.mean(brightest**2)))
    return {
        "ratio": [one.measured_bytes / one.num_bytes for one in found],
        "error": [one.error[-1] for one in found],
        "of_range": [one.error[-1] * to_range for one in found],
        "clusters": [len(one.mean) for one in found],
        "components": [one.num_components for one in found],
    }


def _between(x: list[float], y: list[float], at: float) -> float:
    """Interpolate in logarithms, straight on beyond the ends' values."""
    order = np.argsort(x)
    return float(np.exp(np.interp(np.log(at), np.log(np.array(x)[order]), np.log(np.array(y)[order]))))


def _geometry(values: Values, folder: Path, tiny: bool) -> Figure:
    name = "btf.geometry_rmse"
    if (why := missing()) is not None:
        return skipped((name,), "%", why)[0]
    size, spp = ((16, 16), 2) if tiny else ((96, 96), 64)
    source = folder / "weave.json"
    source.write_text("{}")
    tile = GEOMETRIES["weave"]()
    errors = []
    with STORE.at(folder / "btfs"):
        record = keep(
            folder / "btfs",
            source,
            "Weave",
            "weave",
            lambda: compress(values, _BOUNDS[0], lambda share: None, lambda: False),
        )
        for k, (theta, phi) in enumerate(_EYE):
            plane, real = _scenes(tile, theta, phi)
            recipe = Recipe("direct", ("eye",), size, 60 if tiny else 2000)
            opened = open_bake(bake_here(METHODS["direct"], plane, recipe, folder / f"{k}.zarr"), Memory(2 << 30))
            term = {**record.terms()[0], "color": [1.0, 1.0, 1.0]}
            look = validate({"materials": {"Cloth": {"terms": [term]}}}, opened.default_look)
            ours = render_image(opened, "eye", look)[..., :3]
            to = folder / f"peer{k}"
            to.mkdir()
            integrator = {"type": "path", "max_depth": 8, "rr_depth": 8}
            job = {"spp": [spp], "passes": PASSES, "bsdfs": [bsdf(tile.terms)], "integrator": integrator}
            render(real, size, job, to)
            theirs = np.load(to / "passes.npy", allow_pickle=False)
            errors.append(over_passes(ours.astype(np.float64), theirs))
    worst = max(errors, key=lambda one: one.error.value)
    context: dict[str, Any] = {
        "from": [f"θ {theta}°, φ {phi}°" for theta, phi in _EYE],
        "errors": [one.error.value for one in errors], "biases": [one.bias.value for one in errors],
        "kept_to": record.error[-1], "noise": worst.noise, "spp": PASSES * spp, "size": list(size),
    }  # fmt: skip
    return Figure(name, 100 * worst.error.value, "%", context, 100 * worst.error.standard_error)


def _scenes(tile: Any, theta: float, phi: float) -> tuple[Scene, Scene]:
    """A plane to be covered, and the geometry itself, both y-up, seen from far away."""
    t, p = np.radians([theta, phi])
    towards = np.array([np.sin(t) * np.cos(p), np.cos(t), -np.sin(t) * np.sin(p)])
    far = 60.0
    camera = look_at("eye", tuple(far * towards), (0.0, 0.0, 0.0), 2 * float(np.arctan(0.5 * _SEEN / far)))
    radiance = np.array(studio().radiance)
    radiance[len(radiance) // 2 :] = 0  # a BTF knows no light from below, which holes of the geometry would let through
    sky = Environment("sky", radiance)
    material = (Material("Cloth", tuple(tile.terms)),)
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
