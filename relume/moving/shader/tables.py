"""What a look makes for a shader: tables of materials, light vectors, the sky; each known by what it follows from."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import DEGREE, NUM_FUNCTIONS, QUICK_DEGREE, ladder, num_functions
from relume.brdf.albedo import TEXTURES
from relume.moving.arriving import Arriving
from relume.moving.basis.lobes import NUM_GROUPS, Lobes
from relume.moving.frame import Materials, Wanted
from relume.moving.points.surface import EMISSION, NORMAL_MAP
from relume.moving.sky import turn_of
from relume.moving.transfer import MovingTransfer
from relume.picture.light import emission_of
from relume.views.resolve import encode_pixels

F32 = NDArray[np.float32]
Texels = NDArray[Any]

_ROUGH = -(-num_functions(QUICK_DEGREE) // 4)  # texels of four functions that are not nothing in what is found quickly
_MISSED = 1e-3  # of a table's size, by the functions that a shader leaves out
_LARGEST = 2.0**14  # of light vectors: well inside half precision


class Part(NamedTuple):
    """Some arrays that change together.

    Attributes:
        key: of what they follow from. make: finds them, by name; (texels, 1, 2 or 4) each.
    """

    key: Hashable
    make: Callable[[], Mapping[str, Texels]]


class Numbers(NamedTuple):
    """What a frame needs besides: as `TablesInfo` of the wire says."""

    gain: list[float]
    sky_gain: list[float]
    background_gain: list[float]
    sky_turn: float
    sky_levels: list[list[int]]
    background: str
    background_color: list[float]
    background_size: list[int]
    is_direct: bool


def parts_of(transfer: MovingTransfer, wanted: Wanted, versions: tuple[Hashable, Hashable]) -> dict[str, Part]:
    """Name what a shader must have to show a look.

    Args:
        transfer: of the bake. wanted: what is shown. versions: of its materials, and of its light vectors.
    """
    look, light = wanted.look, wanted.light
    lobes, background = wanted.materials.lobes, look.background
    has_lobes, has_narrow = bool(len(lobes.is_told)), not lobes.is_told.all()
    catchers = tuple(k for k, name in enumerate(transfer.material_names) if look.materials[name].catcher)
    parts = {
        "materials": Part(
            (versions[0], light.local, light.paths.direct, catchers), lambda: _materials(transfer, wanted)
        ),
        "light": Part(
            (versions[1], has_narrow),
            lambda: _light(wanted.arriving, has_narrow=has_narrow, is_rough=wanted.is_rough),
        ),
    }
    if has_lobes or background.kind == "map":
        parts["sky"] = Part(
            light.environment.map, lambda: {"sky": _words(transfer.sky_in(light.environment.map).texels)}
        )
    if background.kind == "blurred":
        key = light.environment.map, background.blur
        parts["background"] = Part(key, lambda: {"background": _words(transfer.map_of(*key).reshape(-1, 3))})
    if catchers:
        parts["unhidden"] = Part(
            (light, catchers, wanted.is_rough), lambda: {"unhidden": _unhidden(transfer, wanted, catchers)}
        )
    return parts


def numbers_of(transfer: MovingTransfer, wanted: Wanted) -> Numbers:
    """Find what a shader needs besides its arrays; see `relume.moving.frame`."""
    look, light = wanted.look, wanted.light
    sky_gain = light.environment_gain if light.paths.direct and light.is_environment_lit else (0.0, 0.0, 0.0)
    radiance, blur = look.background, look.background.blur if look.background.kind == "blurred" else 0.0
    return Numbers(
        gain=[float(x) for x in wanted.gain],
        sky_gain=[float(x) for x in sky_gain],
        background_gain=[float(a * b) for a, b in zip(light.environment_gain, wanted.gain, strict=True)],
        sky_turn=float(turn_of(light.environment.rotation)),
        sky_levels=transfer.sky_in(light.environment.map).levels.tolist(),
        background=radiance.kind,
        background_color=[float(x) for x in radiance.color],
        background_size=list(transfer.map_of(light.environment.map, blur).shape[:2]),
        is_direct=light.paths.direct,
    )


def _materials(transfer: MovingTransfer, wanted: Wanted) -> dict[str, Texels]:
    tables, lobes = wanted.materials.tables, wanted.materials.lobes
    return {
        "even": tables.even.reshape(-1, 4),
        "uneven": tables.uneven.reshape(-1, 4),
        "lobes": _lobes(lobes),
        "materials": _rows(transfer, wanted, wanted.materials),
    }


def _lobes(lobes: Lobes) -> F32:
    """Of each row of each lobe the albedos by groups, then its mean, σ, and whether the in-basis tells it.
    (lobes · rows · (groups + 1), 4)"""
    num, rows = lobes.mean.shape
    out = np.zeros((num, rows, NUM_GROUPS + 1, 4), np.float32)
    out[:, :, :NUM_GROUPS, :3] = lobes.albedo
    out[:, :, NUM_GROUPS, 0], out[:, :, NUM_GROUPS, 1] = lobes.mean, lobes.sigma
    out[:, :, NUM_GROUPS, 2] = lobes.is_told[:, None]
    return out.reshape(-1, 4)


def _rows(transfer: MovingTransfer, wanted: Wanted, materials: Materials) -> NDArray[np.int32]:
    """What each material has: of each group its even and its uneven table, whether it sends, its texture; then its
    lobe, its normal map, whether it is a catcher, how many texels of its light vectors it needs; then the bits of its
    emission, and the image of that. (materials · (groups + 2), 4) int32, −1 for none"""
    tables, lobes, sends = materials.tables, materials.lobes, materials.sends
    of_material = transfer.surface.textures.of_material
    out = np.full((len(sends), NUM_GROUPS + 2, 4), -1, np.int32)
    out[:, :NUM_GROUPS, :2] = tables.of
    out[:, :NUM_GROUPS, 2] = sends
    out[:, 1:NUM_GROUPS, 3] = of_material[:, : len(TEXTURES)]
    out[:, NUM_GROUPS, 0] = lobes.of
    out[:, NUM_GROUPS, 1] = of_material[:, NORMAL_MAP]
    out[:, NUM_GROUPS, 2] = [wanted.look.materials[name].catcher for name in transfer.material_names]
    of_function = np.repeat(np.arange(DEGREE + 1), np.arange(DEGREE + 1) + 1)
    of_even, of_uneven = _degrees(tables.even, of_function[ladder().cosine]), _degrees(tables.uneven, of_function)
    for k, (of, normal_map) in enumerate(zip(tables.of, of_material[:, NORMAL_MAP], strict=True)):
        degrees = [*of_even[of[:, 0][of[:, 0] >= 0]], *of_uneven[of[:, 1][of[:, 1] >= 0]]]
        degree = DEGREE if normal_map >= 0 else max(degrees, default=0)
        out[k, NUM_GROUPS, 3] = -(-num_functions(int(degree)) // 4)
    emission = [(*emission_of(wanted.light, name), 0) for name in transfer.material_names]
    out[:, NUM_GROUPS + 1] = np.array(emission, np.float32).view(np.int32)
    out[:, NUM_GROUPS + 1, 3] = of_material[:, EMISSION]
    return out.reshape(-1, 4)


def _degrees(tables: F32, degree_of: NDArray[np.int64]) -> NDArray[np.int64]:
    """The degree up to which functions matter, of each table (tables, …, functions), whose degrees are given."""
    size = np.square(tables, dtype=np.float64).sum(axis=tuple(range(1, tables.ndim - 1)))
    of_degree = np.stack([size[:, degree_of == degree].sum(axis=1) for degree in range(DEGREE + 1)], axis=1)
    beyond = of_degree[:, ::-1].cumsum(axis=1)[:, ::-1]  # from a degree on
    matters = beyond > _MISSED**2 * np.maximum(beyond[:, :1], 1e-30)
    return np.asarray(matters.sum(axis=1) - 1, np.int64).clip(0)


def _light(arriving: Arriving, *, has_narrow: bool, is_rough: bool) -> dict[str, Texels]:
    """Light vectors in half precision, channel by channel, and by how much they were divided."""
    kept = (_ROUGH if is_rough else NUM_FUNCTIONS // 4) * 4
    vectors = {"vectors": arriving.total} | ({"others": arriving.others} if has_narrow else {})
    out: dict[str, Texels] = {}
    for name, values in vectors.items():
        largest = float(max(values.max(), -values.min(), 1e-30))
        scale = 2.0 ** np.ceil(np.log2(largest / _LARGEST))
        out[name] = np.multiply(values[:, :, :kept], np.float32(1 / scale)).astype(np.float16).reshape(-1, 4)
        out[f"{name}_scale"] = np.array([[scale, kept // 4]], np.float32)
    return out


def _unhidden(transfer: MovingTransfer, wanted: Wanted, catchers: Sequence[int]) -> F32:
    out = np.zeros((transfer.surface.points.num_points, 4), np.float32)
    for material in catchers:
        out[:, :3] += transfer.unhidden(wanted.light, material, is_preview=wanted.is_rough)
    return out


def _words(pixels: F32) -> NDArray[np.uint32]:
    """Radiance in words of RGB9_E5. (n, 1) uint32"""
    return np.frombuffer(encode_pixels(np.ascontiguousarray(pixels), "rgb9e5"), np.uint32)[:, None]
