"""What a look makes for a shader: tables of materials, light vectors, the sky; each known by what it follows from."""

from __future__ import annotations

import json
from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import DEGREE, DEGREES, NUM_FUNCTIONS, QUICK_DEGREE, ladder, num_functions
from relume.brdf.channels import TEXTURES
from relume.moving.basis.lobes import NUM_GROUPS, Lobes
from relume.moving.frame import Materials, Wanted
from relume.moving.highlights.lobe_lights import LobeLights, widths_of
from relume.moving.points.surface import EMISSION, NORMAL_MAP
from relume.moving.shader.geometry import first_points, textures_with
from relume.moving.shader.highlights import shape_of, sky_lights
from relume.moving.sky import turn_of
from relume.moving.transfer import MovingTransfer
from relume.picture.light import emission_of
from relume.views.resolve import encode_pixels

F32 = NDArray[np.float32]
Texels = NDArray[Any]

_ROUGH = num_functions(QUICK_DEGREE)  # that are not nothing in what is found quickly
_KEPT = np.array([1, _ROUGH, NUM_FUNCTIONS])  # how many are sent: a shader is written for each number
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
    lamps: list[list[float]]
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
    catchers = tuple(k for k, name in enumerate(transfer.material_names) if look.materials[name].catcher)
    parts = {
        "materials": Part(
            (versions[0], light.local, light.paths.direct, catchers), lambda: _materials(transfer, wanted)
        ),
    }
    surface = transfer.surface_with(wanted.materials.wears)
    if surface is not transfer.surface:
        parts["images"] = Part(wanted.materials.wears, lambda: textures_with(transfer.surface, surface))
    needs = needed_functions(wanted.materials, surface.textures.of_material[:, NORMAL_MAP] >= 0)
    of_all, first = (wanted.arriving.total, wanted.arriving.others), first_points(transfer)
    for name, vectors, needed in zip(("vectors", "others"), of_all, needs, strict=True):
        most = np.minimum(needed, _ROUGH) if wanted.is_rough else needed
        for k in np.flatnonzero(most * np.diff(first)):
            of_points, key = vectors[first[k] : first[k + 1]], f"{name}/{k}"
            parts[key] = Part((versions[1], most[k]), partial(_light, key, of_points, int(most[k])))
    parts |= _in_highlights(transfer, wanted)
    if len(lobes.most) or background.kind == "map":
        parts["sky"] = Part(
            light.environment.map, lambda: {"sky": _words(transfer.sky_in(light.environment.map).texels)}
        )
    if widths := widths_of(lobes):
        parts["lobe_lights"] = Part(
            (light.environment, widths), lambda: _listed(transfer.lobe_lights(light.environment, widths))
        )
    if background.kind == "blurred":
        blurred = light.environment.map, background.blur
        parts["background"] = Part(blurred, lambda: {"background": _words(transfer.map_of(*blurred).reshape(-1, 3))})
    if catchers:
        parts["unhidden"] = Part(
            (light, catchers, wanted.is_rough), lambda: {"unhidden": _unhidden(transfer, wanted, catchers)}
        )
    return parts


def numbers_of(transfer: MovingTransfer, wanted: Wanted) -> Numbers:
    """Find what a shader needs besides its arrays; see `relume.moving.frame`."""
    look, light = wanted.look, wanted.light
    sky_gain = light.environment_gain if light.shows_sky else (0.0, 0.0, 0.0)
    radiance, blur = look.background, look.background.blur if look.background.kind == "blurred" else 0.0
    return Numbers(
        gain=[float(x) for x in wanted.gain],
        sky_gain=[float(x) for x in sky_gain],
        background_gain=[float(a * b) for a, b in zip(light.environment_gain, wanted.gain, strict=True)],
        sky_turn=float(turn_of(light.environment.rotation)),
        sky_levels=transfer.sky_in(light.environment.map).levels.tolist(),
        lamps=transfer.lamps_in(light.environment).tolist(),
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


def _in_highlights(transfer: MovingTransfer, wanted: Wanted) -> dict[str, Part]:
    """The lights of the sky, and the shape of the highlight of each material that they are summed for."""
    environment, lobes, is_rough = wanted.light.environment, wanted.materials.lobes, wanted.is_rough
    bumpiness, each = transfer.surface_with(wanted.materials.wears).bumpiness, wanted.materials.each
    shapes = {
        f"shapes/{k}": Part(
            (json.dumps(each[k].terms, sort_keys=True), float(bumpiness[k])), partial(shape_of, lobes, k, bumpiness)
        )
        for k in np.flatnonzero(lobes.of >= 0).tolist()
        if lobes.most[lobes.of[k]] == 1
    }
    if not shapes:
        return {}
    lights = Part((environment, is_rough), lambda: sky_lights(transfer.sky_lights(environment, is_preview=is_rough)))
    return {**shapes, "sky_lights": lights}


def _lobes(lobes: Lobes) -> F32:
    """Of each row of each lobe the albedos by groups, with `most`, σ_2, √(1 − R); then both cosines, s_1 and σ_1.
    (lobes · rows · (groups + 1), 4)"""
    num, rows = lobes.first.shape
    out = np.zeros((num, rows, NUM_GROUPS + 1, 4), np.float32)
    out[:, :, :NUM_GROUPS, :3] = lobes.albedo
    out[:, :, 0, 3], out[:, :, 1, 3], out[:, :, 2, 3] = lobes.most[:, None], lobes.sigma[..., 1], lobes.wide
    out[:, :, NUM_GROUPS] = np.concatenate([lobes.cosine, lobes.first[..., None], lobes.sigma[..., :1]], axis=-1)
    return out.reshape(-1, 4)


def _listed(listed: LobeLights) -> dict[str, Texels]:
    """Lights that lobes look for, two texels each; lists of four a texel, −1 after the last; the first
    list of each width; of each lamp its lights and their shares."""
    lights = np.zeros((len(listed.lights), 8), np.float32)
    lights[:, :5] = listed.lights
    lamps = np.stack([listed.lamps.astype(np.float32), listed.share], axis=-1)
    return {
        "lobe_lights": lights.reshape(-1, 4),
        "lobe_lists": listed.lists.reshape(-1, 4),
        "lobe_firsts": listed.first[:, None],
        "lights_of_lamps": np.ascontiguousarray(lamps.reshape(-1, 2)) if lamps.size else np.zeros((1, 2), np.float32),
    }


def _rows(transfer: MovingTransfer, wanted: Wanted, materials: Materials) -> NDArray[np.int32]:
    """What each material has: of each group its even and its uneven table, whether it sends, its texture; then its
    lobe, its normal map, whether it is a catcher, −1; then the bits of its emission, and the image of that; then of
    each group both tables of the sky in its highlights, and both of other light. −1 for none.
    (materials · (2 groups + 2), 4) int32"""
    tables, lobes, sends = materials.tables, materials.lobes, materials.sends
    of_material = transfer.surface_with(materials.wears).textures.of_material
    out = np.full((len(sends), 2 * NUM_GROUPS + 2, 4), -1, np.int32)
    out[:, :NUM_GROUPS, :2], out[:, NUM_GROUPS + 2 :] = tables.of[..., :2], tables.of[..., 2:]
    out[:, :NUM_GROUPS, 2] = sends
    out[:, 1:NUM_GROUPS, 3] = of_material[:, : len(TEXTURES)]
    out[:, NUM_GROUPS, 0] = lobes.of
    out[:, NUM_GROUPS, 1] = of_material[:, NORMAL_MAP]
    out[:, NUM_GROUPS, 2] = [wanted.look.materials[name].catcher for name in transfer.material_names]
    emission = [(*emission_of(wanted.light, name), 0) for name in transfer.material_names]
    out[:, NUM_GROUPS + 1] = np.array(emission, np.float32).view(np.int32)
    out[:, NUM_GROUPS + 1, 3] = of_material[:, EMISSION]
    return out.reshape(-1, 4)


def needed_functions(materials: Materials, has_map: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find how many functions of light vectors materials get: at least up to the degree that their tables know, all
    where a normal map asks where light comes from.

    Args:
        materials: what they send. has_map: whether each has a normal map. (materials,)
    Returns:
        Of vectors of all light, and of those of others than the sky, which highlights send apart. (materials,) each
    """
    tables = materials.tables
    of_even, of_uneven = _degrees(tables.even, DEGREES[ladder().cosine]), _degrees(tables.uneven, DEGREES)

    def needed(columns: slice) -> NDArray[np.int64]:
        out = np.zeros(len(tables.of), np.int64)
        for k, of in enumerate(tables.of[..., columns]):
            even, uneven = of[:, ::2], of[:, 1::2]
            degrees = [*of_even[even[even >= 0]], *of_uneven[uneven[uneven >= 0]]]
            out[k] = _KEPT[np.searchsorted(_KEPT, num_functions(max(degrees)))] if degrees else 0
        return out

    total = needed(slice(0, 4))
    total[has_map] = NUM_FUNCTIONS
    return total, needed(slice(2, 6))


def _degrees(tables: F32, degree_of: NDArray[np.int64]) -> NDArray[np.int64]:
    """The degree up to which functions matter, of each table (tables, …, functions), whose degrees are given."""
    size = np.square(tables, dtype=np.float64).sum(axis=tuple(range(1, tables.ndim - 1)))
    of_degree = np.stack([size[:, degree_of == degree].sum(axis=1) for degree in range(DEGREE + 1)], axis=1)
    beyond = of_degree[:, ::-1].cumsum(axis=1)[:, ::-1]  # from a degree on
    matters = beyond > _MISSED**2 * np.maximum(beyond[:, :1], 1e-30)
    return np.asarray(matters.sum(axis=1) - 1, np.int64).clip(0)


def _light(name: str, vectors: F32, num: int) -> dict[str, Texels]:
    """So many functions of light vectors of points in half precision, channel by channel, each point in whole texels;
    and by how much they were divided, and how many functions there are."""
    largest = float(max(vectors.max(initial=0), -vectors.min(initial=0), 1e-30))
    scale = 2.0 ** np.ceil(np.log2(largest / _LARGEST))
    out = np.zeros((len(vectors), -(-3 * num // 4) * 4), np.float16)
    out[:, : 3 * num] = np.multiply(vectors[:, :, :num], np.float32(1 / scale)).reshape(len(vectors), -1)
    return {name: out.reshape(-1, 4), f"{name}/scale": np.array([[scale, num]], np.float32)}


def _unhidden(transfer: MovingTransfer, wanted: Wanted, catchers: Sequence[int]) -> F32:
    out = np.zeros((transfer.surface.points.num_points, 4), np.float32)
    for material in catchers:
        out[:, :3] += transfer.unhidden(wanted.light, material, is_preview=wanted.is_rough)
    return out


def _words(pixels: F32) -> NDArray[np.uint32]:
    """Radiance in words of RGB9_E5. (n, 1) uint32"""
    return np.frombuffer(encode_pixels(np.ascontiguousarray(pixels), "rgb9e5"), np.uint32)[:, None]
