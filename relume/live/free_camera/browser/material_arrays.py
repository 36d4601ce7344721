"""Arrays of a look for the browser's renderer: material tables, incident coefficients, environment; each with a key."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.frozen_term import FrozenTerm
from relume.brdf.texture_slots import TEXTURES
from relume.live.fixed_camera.illumination import material_emissions
from relume.live.free_camera.basis.highlight_lobes import NUM_GROUPS, Lobes
from relume.live.free_camera.basis.lobe_shapes import NUM_AZIMUTHS, NUM_GRID_DIRECTIONS
from relume.live.free_camera.basis.outgoing_coefficients import NUM_ROWS
from relume.live.free_camera.browser.geometry_arrays import first_probes, overridden_texture_arrays, visible_lights
from relume.live.free_camera.environment_lookup import rotation_of
from relume.live.free_camera.frame import FrameRequestState, MaterialState
from relume.live.free_camera.highlights.interpolated_highlights import NORMAL_VARIANCE_FACTOR
from relume.live.free_camera.highlights.light_sum_kernel import EnvironmentLights
from relume.live.free_camera.highlights.lobe_light_lists import LobeLightLists, lobe_widths
from relume.live.free_camera.protocol import FreeCameraTransfer
from relume.math.zernike import FAST_DEGREE, NUM_FUNCTIONS, num_functions
from relume.raytrace.surface_textures import EMISSION, NORMAL_MAP
from relume.views.resolve import encode_pixels

F32 = NDArray[np.float32]
Texels = NDArray[Any]

_NUM_COARSE_FUNCTIONS = num_functions(FAST_DEGREE)  # nonzero functions of approximate coefficients
# possible numbers of functions; a shader is generated for each
_FUNCTION_COUNTS = np.array([1, _NUM_COARSE_FUNCTIONS, NUM_FUNCTIONS])
_MAX_HALF = 65504.0
_MAX_SCALED = 2.0**14  # of coefficients: well inside half precision


class ArrayBlock(NamedTuple):
    """Arrays that change together.

    Attributes:
        key: identifies their content. make: returns them by name; (texels, 1, 2 or 4) each.
    """

    key: Hashable
    make: Callable[[], Mapping[str, Texels]]


class ShaderConstants(NamedTuple):
    """Other data of a frame: the fields of the message `SceneUpdate`."""

    gain: list[float]
    environment_gain: list[float]
    background_gain: list[float]
    environment_rotation: float
    environment_mips: list[list[int]]
    bright_lights: list[list[float]]
    background: str
    background_color: list[float]
    background_size: list[int]
    shows_direct: bool


def array_blocks(
    transfer: FreeCameraTransfer, state: FrameRequestState, versions: tuple[Hashable, Hashable]
) -> dict[str, ArrayBlock]:
    """Return the array blocks that a shader needs to show a look, by name.

    Args:
        transfer: transfer of the bake. state: state of the frame.
        versions: versions of its materials, and of its incident coefficients.
    """
    look, light = state.look, state.light
    lobes, background = state.materials.lobes, look.background
    catchers = tuple(k for k, name in enumerate(transfer.material_names) if look.materials[name].shadow_catcher)
    blocks = {
        "materials": ArrayBlock(
            (versions[0], light.local, light.paths.direct, catchers), lambda: _materials(transfer, state)
        ),
    }
    stored_scene = transfer.stored_scene_with(state.materials.overrides)
    if stored_scene is not transfer.stored_scene:
        blocks["images"] = ArrayBlock(
            state.materials.overrides, lambda: overridden_texture_arrays(transfer.stored_scene, stored_scene)
        )
    num_needed = needed_function_counts(state.materials, stored_scene.textures.material_textures[:, NORMAL_MAP] >= 0)
    incident_vectors, first = (state.incident.total, state.incident.non_environment), first_probes(transfer)
    for name, vectors, needed in zip(("vectors", "others"), incident_vectors, num_needed, strict=True):
        function_counts = np.minimum(needed, _NUM_COARSE_FUNCTIONS) if state.is_coarse else needed
        for k in np.flatnonzero(function_counts * np.diff(first)):
            probe_vectors, key = vectors[first[k] : first[k + 1]], f"{name}/{k}"
            blocks[key] = ArrayBlock(
                (versions[1], function_counts[k]), partial(_vector_arrays, key, probe_vectors, int(function_counts[k]))
            )
    blocks |= _highlight_blocks(transfer, state)
    if len(lobes.max_ratio) or background.kind == "map":
        blocks["environment"] = ArrayBlock(
            light.environment.map,
            lambda: {"environment": _encode_rgb9e5(transfer.prefiltered(light.environment.map).texels)},
        )
    if widths := lobe_widths(lobes):
        blocks["lobe_lights"] = ArrayBlock(
            (light.environment, widths), lambda: _lobe_light_arrays(transfer.lobe_lights(light.environment, widths))
        )
    if (link := light.environment.link) is not None:
        blocks["linked_lights"] = ArrayBlock(link, lambda: {"visible_lights": visible_lights(transfer, link)})
    if background.kind == "blurred":
        blurred = light.environment.map, background.blur
        blocks["background"] = ArrayBlock(
            blurred, lambda: {"background": _encode_rgb9e5(transfer.environment_map(*blurred).reshape(-1, 3))}
        )
    if catchers:
        blocks["unoccluded"] = ArrayBlock(
            (light, catchers, state.is_coarse), lambda: {"unoccluded": _unoccluded(transfer, state, catchers)}
        )
    return blocks


def shader_constants(transfer: FreeCameraTransfer, state: FrameRequestState) -> ShaderConstants:
    """Return the data that a shader needs besides arrays; see `relume.live.free_camera.frame`."""
    look, light = state.look, state.light
    environment_gain = light.environment_gain if light.has_direct_environment else (0.0, 0.0, 0.0)
    radiance, blur = look.background, look.background.blur if look.background.kind == "blurred" else 0.0
    return ShaderConstants(
        gain=[float(x) for x in state.gain],
        environment_gain=[float(x) for x in environment_gain],
        background_gain=[float(a * b) for a, b in zip(light.environment_gain, state.gain, strict=True)],
        environment_rotation=float(rotation_of(light.environment.rotation)),
        environment_mips=transfer.prefiltered(light.environment.map).levels.tolist(),
        bright_lights=transfer.bright_lights(light.environment).tolist(),
        background=radiance.kind,
        background_color=[float(x) for x in radiance.color],
        background_size=list(transfer.environment_map(light.environment.map, blur).shape[:2]),
        shows_direct=light.paths.direct,
    )


def _materials(transfer: FreeCameraTransfer, state: FrameRequestState) -> dict[str, Texels]:
    tables, lobes = state.materials.tables, state.materials.lobes
    return {
        "isotropic": tables.isotropic.reshape(-1, 4),
        "anisotropic": tables.anisotropic.reshape(-1, 4),
        "lobes": _lobes(lobes),
        "materials": _material_rows(transfer, state, state.materials),
    }


def _highlight_blocks(transfer: FreeCameraTransfer, state: FrameRequestState) -> dict[str, ArrayBlock]:
    """The environment lights, and the shape of each material's highlight that is summed over them."""
    environment, lobes, is_coarse = state.light.environment, state.materials.lobes, state.is_coarse
    normal_variation, projected = (
        transfer.stored_scene_with(state.materials.overrides).normal_variation,
        state.materials.projected,
    )
    shapes = {
        f"shapes/{k}": ArrayBlock(
            (tuple(map(FrozenTerm.from_document, projected[k].terms)), float(normal_variation[k])),
            partial(_lobe_shape_array, lobes, k, normal_variation),
        )
        for k in np.flatnonzero(lobes.lobe_index >= 0).tolist()
        if lobes.max_ratio[lobes.lobe_index[k]] == 1
    }
    if not shapes:
        return {}
    lights = ArrayBlock(
        (environment, is_coarse),
        lambda: _environment_light_array(transfer.environment_lights(environment, is_preview=is_coarse)),
    )
    return {**shapes, "environment_lights": lights}


def _lobes(lobes: Lobes) -> F32:
    """Per row of each lobe: albedos by groups, with `max_ratio`, σ_2, √(1 − R) as fourth components; then both cosines,
    s_1 and σ_1. (lobes · rows · (groups + 1), 4)
    """
    num, rows = lobes.first.shape
    out = np.zeros((num, rows, NUM_GROUPS + 1, 4), np.float32)
    out[:, :, :NUM_GROUPS, :3] = lobes.albedo
    out[:, :, 0, 3], out[:, :, 1, 3], out[:, :, 2, 3] = (
        lobes.max_ratio[:, None],
        lobes.sigma[..., 1],
        lobes.single_sigma,
    )
    out[:, :, NUM_GROUPS] = np.concatenate([lobes.cosine, lobes.first[..., None], lobes.sigma[..., :1]], axis=-1)
    return out.reshape(-1, 4)


def _lobe_light_arrays(lobe_lights: LobeLightLists) -> dict[str, Texels]:
    """Lights in lobes, two texels each; lists with four lights per texel, −1 after the last; the first list of each
    width; lights and weights of each bright light.
    """
    lights = np.zeros((len(lobe_lights.lights), 8), np.float32)
    lights[:, :5] = lobe_lights.lights
    bright_lights = np.stack([lobe_lights.bright_lights.astype(np.float32), lobe_lights.bright_light_weights], axis=-1)
    return {
        "lobe_lights": lights.reshape(-1, 4),
        "lobe_lists": lobe_lights.lists.reshape(-1, 4),
        "lobe_firsts": lobe_lights.first[:, None],
        "bright_light_members": np.ascontiguousarray(bright_lights.reshape(-1, 2))
        if bright_lights.size
        else np.zeros((1, 2), np.float32),
    }


def _material_rows(
    transfer: FreeCameraTransfer, state: FrameRequestState, materials: MaterialState
) -> NDArray[np.int32]:
    """Rows of each material; −1 for none. (materials · (2 groups + 2), 4) int32

    Per group: its isotropic and anisotropic table, 1 if it reflects, its texture. Then its lobe, its normal map, 1 for
    a shadow catcher, 1 if it emits to both sides. Then the bits of its emission, and its emission texture. Then per
    group both tables of the environment in highlights, and both of other light.
    """
    tables, lobes, is_reflective = materials.tables, materials.lobes, materials.is_reflective
    material_textures = transfer.stored_scene_with(materials.overrides).textures.material_textures
    out = np.full((len(is_reflective), 2 * NUM_GROUPS + 2, 4), -1, np.int32)
    out[:, :NUM_GROUPS, :2], out[:, NUM_GROUPS + 2 :] = tables.table_index[..., :2], tables.table_index[..., 2:]
    out[:, :NUM_GROUPS, 2] = is_reflective
    out[:, 1:NUM_GROUPS, 3] = material_textures[:, : len(TEXTURES)]
    out[:, NUM_GROUPS, 0] = lobes.lobe_index
    out[:, NUM_GROUPS, 1] = material_textures[:, NORMAL_MAP]
    out[:, NUM_GROUPS, 2] = [state.look.materials[name].shadow_catcher for name in transfer.material_names]
    out[:, NUM_GROUPS, 3] = transfer.stored_scene.is_two_sided
    emission = material_emissions(state.light, transfer.material_names, is_visible=True)
    out[:, NUM_GROUPS + 1, :3] = emission.view(np.int32)
    out[:, NUM_GROUPS + 1, 3] = material_textures[:, EMISSION]
    return out.reshape(-1, 4)


def needed_function_counts(
    materials: MaterialState, has_map: Shaped[NDArray[np.bool_], " materials"]
) -> tuple[Shaped[NDArray[np.int64], " materials"], Shaped[NDArray[np.int64], " materials"]]:
    """Return the number of functions of incident coefficients per material: at least up to the degree of its tables,
    all with a normal map.

    Args:
        materials: materials of the look. has_map: materials with a normal map.
    Returns:
        For all light, and for light other than the environment, which highlights add separately.
    """
    degree = materials.tables.degree

    def needed(columns: slice) -> NDArray[np.int64]:
        highest = degree[:, columns].max(axis=1).astype(np.int64)
        count = _FUNCTION_COUNTS[np.searchsorted(_FUNCTION_COUNTS, (highest + 1) * (highest + 2) // 2)]
        return np.where(highest >= 0, count, 0)

    total = needed(slice(0, 2))
    total[has_map] = NUM_FUNCTIONS
    return total, needed(slice(1, 3))


def _vector_arrays(name: str, vectors: F32, num: int) -> dict[str, Texels]:
    """Pack coefficients of probes in half precision, channel by channel, each probe in whole texels; and their scale
    and number of functions.
    """
    largest = float(max(vectors.max(initial=0), -vectors.min(initial=0), 1e-30))
    scale = 2.0 ** np.ceil(np.log2(largest / _MAX_SCALED))
    out = np.zeros((len(vectors), -(-3 * num // 4) * 4), np.float16)
    out[:, : 3 * num] = np.multiply(vectors[:, :, :num], np.float32(1 / scale)).reshape(len(vectors), -1)
    return {name: out.reshape(-1, 4), f"{name}/scale": np.array([[scale, num]], np.float32)}


def _unoccluded(transfer: FreeCameraTransfer, state: FrameRequestState, catchers: Sequence[int]) -> F32:
    out = np.zeros((transfer.stored_scene.probes.num_points, 4), np.float32)
    for material in catchers:
        out[:, :3] += transfer.unoccluded(state.light, material, is_preview=state.is_coarse)
    return out


def _encode_rgb9e5(pixels: F32) -> NDArray[np.uint32]:
    """Radiance encoded as RGB9_E5. (n, 1) uint32"""
    return np.frombuffer(encode_pixels(np.ascontiguousarray(pixels), "rgb9e5"), np.uint32)[:, None]


def _environment_light_array(lights: EnvironmentLights) -> dict[str, Texels]:
    """Return the direction and width index of each light, then its irradiance.

    Args:
        lights: of the environment.
    Returns:
        (2 lights, 4) float32
    """
    width = (lights.table // NUM_GRID_DIRECTIONS).astype(np.float32)
    directions, irradiance = np.split(lights.lights, 2, axis=1)
    rows = np.column_stack([directions, width, irradiance, np.zeros_like(width)])
    return {"environment_lights": np.ascontiguousarray(rows.reshape(-1, 4))}


def _lobe_shape_array(lobes: Lobes, material: int, normal_variation: Shaped[F32, " materials"]) -> dict[str, Texels]:
    """Return the table of a material's highlight.

    Args:
        lobes: of all materials. material: one with a lobe. normal_variation: of all, see
            `relume.live.free_camera.probes.stored_scene.StoredScene`.
    Returns:
        Of each row 1 − β, α², and the weight of the table for varying normals; then, for each width and ring, the
        values at its first four azimuths, and at its last four. (rows · (1 + widths · rings · 2), 4) float16
    """
    lobe = int(lobes.lobe_index[material])
    ring_values = lobes.shape[lobe].reshape(NUM_ROWS, -1, NUM_AZIMUTHS)
    halves = np.stack([ring_values[..., :4], ring_values[..., -4:]], axis=2).reshape(NUM_ROWS, -1, 4)
    sigma2, head = np.square(lobes.sigma[lobe].min(axis=1)), np.zeros((NUM_ROWS, 1, 4), np.float32)
    head[:, 0, 0], head[:, 0, 1] = lobes.lobe_confidence[lobe], lobes.flatness[lobe]
    head[:, 0, 2] = sigma2 / (sigma2 + NORMAL_VARIANCE_FACTOR * normal_variation[material])
    texels = np.clip(np.concatenate([head, halves], axis=1), -_MAX_HALF, _MAX_HALF)
    return {f"shapes/{material}": texels.astype(np.float16).reshape(-1, 4)}
