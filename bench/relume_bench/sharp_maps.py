"""sharp.rmse_normal_map, sharp.peak_normal_map; sharp.rmse_roughness_map, sharp.rmse_anisotropic: polished maps.

Polished shapes on a gray floor under an environment with a large soft sun, in two scenes, because no ball should mirror
the glitter of bumps: a ball and a tilted panel with a normal map of bumps from three texels to 24, whose finest are
smaller than a pixel; and a ball whose roughness map has spots from 0.03 to 0.6 beside a brushed one, anisotropic Ward.
Method `gather`, all light, exact image of 640×480 against Mitsuba with the same maps, averaged over 2 × 2 pixels, its
noise removed; errors over the pixels of each shape. Peak: the 99.9th percentile of luminance over the normal-mapped
pixels, ours ÷ Mitsuba's.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import luminance
from relume.look import validate
from relume.output.render_image import render_image
from relume.scene.examples.cornell import rectangle, sunny_environment
from relume.scene.examples.still_life.grids import GridSurface, rotation_y, sphere
from relume.scene.examples.still_life.still_life import look_at
from relume.scene.model import Material, Scene, Texture, TextureEncoding
from relume.scene.scene_folder import make_scene
from relume_bench import sharp
from relume_bench.figure import Figure, skipped
from relume_bench.indirect import PASSES
from relume_bench.mitsuba import averaged, bsdf, cached_passes, missing

F32 = NDArray[np.float32]

_MASKS: dict[str, dict[str, tuple[str, ...]]] = {
    "bumps": {"normal_map": ("Bumpy ball", "Bumpy panel")},
    "balls": {"roughness_map": ("Spotted ball",), "anisotropic": ("Brushed ball",)},
}
_SPP, _SIDE, _PEAK = 16, 1024, 99.9
_SLOPE = 0.12  # root mean square of the bumps
_BUMPY_ROUGHNESS, _ROUGHNESSES, _ALPHAS = 0.1, (0.03, 0.6), (0.02, 0.2)
_F0 = (0.95, 0.9, 0.8)
_BALL = sphere(0.34, 96)


def measure(tiny: bool, kind: str) -> list[Figure]:
    """A bake and a render. kind: "bumps" or "balls", the scene"""
    names = tuple(f"sharp.rmse_{name}" for name in _MASKS[kind])
    if (why := missing()) is not None:
        peaks = ("sharp.peak_normal_map",) if kind == "bumps" else ()
        return [*skipped(names, sharp.UNIT, why), *skipped(peaks, "ratio", why)]
    scene, sizes, spp = make_map_scene(kind), sharp.Sizes.choose(tiny), 2 if tiny else _SPP
    with tempfile.TemporaryDirectory() as folder:
        transfer = sharp.bake_and_open(scene, tiny, Path(folder))
        image = render_image(transfer, sharp.VIEW, validate({}, transfer.default_look))
        material_ids, material_names = transfer.views[sharp.VIEW].material_ids(), transfer.material_names
    passes = render_mitsuba(scene, sizes.size, spp)
    context = {"size": list(sizes.size), "lights": sizes.lights, "spp": PASSES * spp}
    masks = {
        key: np.isin(material_ids, [material_names.index(name) for name in names])
        for key, names in _MASKS[kind].items()
    }
    figures = [
        sharp.compare_images(f"sharp.rmse_{name}", image, passes, mask, context, "inside")
        for name, mask in masks.items()
    ]
    if kind == "bumps":
        figures.append(_compare_peaks(image, passes, masks["normal_map"], context))
    return figures


def _compare_peaks(image: F32, passes: F32, mask: NDArray[np.bool_], context: dict[str, Any]) -> Figure:
    """Ratio of the percentiles of luminance, ours ÷ Mitsuba's; see the module."""
    inside = averaged(np.repeat(mask[..., None], 3, axis=2), sharp.FINER)[..., 0] > 0.5
    ours, mitsuba = (
        np.percentile(luminance(np.asarray(averaged(picture, sharp.FINER), np.float32))[inside], _PEAK)
        for picture in (image, passes.mean(axis=0))
    )
    return Figure("sharp.peak_normal_map", float(ours / mitsuba), "ratio", {"mitsuba": float(mitsuba), **context})


def make_map_scene(kind: str) -> Scene:
    """The scenes of this benchmark. kind: as in `measure`"""
    floor = Material("Floor", ({"model": "lambert", "color": [0.3] * 3},))
    surfaces, shapes = [rectangle((-3, 0, 2), (6, 0, 0), (0, 0, -5))], _bumps() if kind == "bumps" else _balls()
    materials = [floor, *(material for material, _ in shapes)]
    surfaces += [surface for _, surface in shapes]
    meshes = [surface.mesh(materials[k].name, k) for k, surface in enumerate(surfaces)]
    camera = look_at(sharp.VIEW, (0.0, 0.95, 3.3), (0.0, 0.42, 0.0), float(np.radians(34.0)))
    environment = sunny_environment(np.array([-0.35, 0.75, 0.6]), radius=float(np.radians(5.0)))
    return make_scene(f"polished {kind}", meshes, materials, [camera], environment)


def _bumps() -> list[tuple[Material, GridSurface]]:
    """The normal-mapped shapes."""
    normal_map = Texture(make_bumps())
    params = {"roughness": _BUMPY_ROUGHNESS, "f0": list(_F0)}
    terms = ({"model": "ggx", "params": params, "color": [1.0] * 3, "texture": None, "roughness_map": "roughness"},)
    return [
        (Material("Bumpy ball", terms, normal_map=normal_map), _BALL.transform(np.eye(3), [-0.4, 0.34, 0])),
        (
            Material("Bumpy panel", terms, normal_map=normal_map),
            rectangle((-1.3, 0.0, -0.55), (2.6, 0, 0), (0, 1.0, -0.5)),
        ),
    ]


def _balls() -> list[tuple[Material, GridSurface]]:
    """The ball with a roughness map, and the brushed one."""
    spots = make_spots()
    mean = float(spots.mean())
    texels = np.round(255 * spots).astype(np.uint8)[..., None]
    params = {"roughness": round(mean, 6), "f0": 1.0}
    spotted = {"model": "ggx", "params": params, "color": [1.0] * 3, "texture": None, "roughness_map": "roughness"}
    alphas = dict(zip(("alpha_x", "alpha_y"), _ALPHAS, strict=True))
    brushed = {"model": "ward_anisotropic", "params": alphas, "color": list(_F0), "texture": None}
    roughness = Texture(texels, encoding=TextureEncoding("share", (1 / mean,) * 3))
    return [
        (
            Material("Spotted ball", (spotted,), {"roughness": roughness}),
            _BALL.transform(rotation_y(40), [-0.5, 0.34, 0]),
        ),
        (Material("Brushed ball", (brushed,)), _BALL.transform(np.eye(3), [0.5, 0.34, 0])),
    ]


def make_bumps() -> Shaped[F32, "side side 3"]:
    """Normals of band-limited noise: wavelengths from 3 to 24 texels, equal variance in each octave."""
    rng = np.random.default_rng(11)
    frequency = np.fft.fftfreq(_SIDE)
    length = np.hypot(frequency[:, None], frequency)
    is_inside = (length >= 1 / 24) & (length <= 1 / 3)
    noise = np.fft.fft2(rng.standard_normal((_SIDE, _SIDE)))
    height = np.where(is_inside, noise / np.maximum(length, 1e-6) ** 2, 0)
    slopes = [np.fft.ifft2(2j * np.pi * axis * height).real for axis in (frequency[None, :], frequency[:, None])]
    scale = _SLOPE / np.sqrt(np.mean(np.square(slopes)))
    normal = np.stack([-scale * slopes[0], -scale * slopes[1], np.ones((_SIDE, _SIDE))], axis=-1)
    return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True), np.float32)


def make_spots() -> Shaped[F32, "rows columns"]:
    """Roughness of soft spots."""
    y, x = np.mgrid[0:256, 0:256] * (2 * np.pi / 256)
    low, high = _ROUGHNESSES
    return np.asarray(low + (high - low) * (0.5 + 0.5 * np.sin(6 * x) * np.cos(4 * y)), np.float32)


def render_mitsuba(scene: Scene, size: tuple[int, int], spp: int) -> Shaped[F32, "passes height width 3"]:
    """Mitsuba's images of a scene with the same maps. size: in pixels. spp: paths a pixel and pass"""
    images = {"bumps": 0.5 + 0.5 * make_bumps(), "alpha": np.square(make_spots())[..., None]}
    job = sharp.make_job([_describe(material) for material in scene.materials])
    return cached_passes(scene, size, {**job, "spp": [spp]}, images)


def _describe(material: Material) -> dict[str, Any]:
    if material.name == "Spotted ball":
        return {
            "type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": {"array": "alpha"},
            "specular_reflectance": {"type": "rgb", "value": [1.0] * 3},
        }  # fmt: skip
    if material.name == "Brushed ball":
        return {"type": "ward", "gain": list(_F0), "alpha_x": _ALPHAS[0], "alpha_y": _ALPHAS[1]}
    plain = bsdf(material.terms)
    if material.normal_map is None:
        return plain
    return {"type": "normalmap", "normalmap": {"array": "bumps"}, "bsdf": plain}
