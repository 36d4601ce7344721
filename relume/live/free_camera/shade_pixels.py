"""Shade pixels from interpolated probe radiance; textures, normal maps and reflection lobes are evaluated per pixel."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import LUMINANCE
from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.basis.highlight_lobes import NUM_GROUPS, Lobes
from relume.live.free_camera.highlights.environment_lobe_lookup import (
    PrefilteredEnvironment,
    add_environment_in_lobe,
    evaluate_lobe,
    evaluate_two_lobes,
)
from relume.live.free_camera.normal_mapping import normal_tilt, normalize, shading_ratio
from relume.live.free_camera.primary_visibility import GBuffer
from relume.probes.stored_scene import StoredScene
from relume.raytrace.surface_textures import EMISSION, NORMAL_MAP
from relume.raytrace.texture_kernels import sample_texture

F32 = NDArray[np.float32]

_MIN_SLANT = np.float32(0.05)  # cosine below which footprints stop growing
_CHUNKS_PER_THREAD = 4  # per thread: a ray that hits a glossy surface costs five times as much as others
# of the lobe's radiance, that negative probe radiance may subtract: more would be a black patch
_MAX_NEGATIVE_RATIO = np.float32(0.5)
_MAX_GRADIENT_RATIO = np.float32(0.125)  # of a pixel's radiance, that the lobe gradient may add or subtract
_RED, _GREEN, _BLUE = (np.float32(coefficient) for coefficient in LUMINANCE)
_FULLY_ABOVE = np.float32(10)  # widths above the horizon at which a lobe counts as fully above; 4e-8 is below


class MirrorData(NamedTuple):
    """Radiance of reflection lobes.

    Attributes:
        lobes: lobes of all materials. environment: prefiltered.
        lobe_visibility: lobe visibility of lattice nodes along their lobes, from
            `relume.live.free_camera.highlights.lobe_visibility`.
        gradients: gradients of lattice nodes, from `relume.live.free_camera.highlights.lobe_gradients`.
        is_fine: use two lobes for every highlight, as at probes, not only for those that need it.
    """

    lobes: Lobes
    environment: PrefilteredEnvironment
    lobe_visibility: Shaped[F32, "nodes 3"]
    gradients: Shaped[F32, "nodes 4"]
    is_fine: bool


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def blend(values, lattice_node, weight):  # type: ignore[no-untyped-def]
    """Interpolate vectors between the three lattice nodes of a pixel.

    Args:
        values: values of all nodes. (nodes, 3). lattice_node: the three, a tuple. weight: weight of each, a tuple.
    """
    x = y = z = np.float32(0)
    for k in range(3):
        v, w = lattice_node[k], weight[k]
        x, y, z = x + w * values[v, 0], y + w * values[v, 1], z + w * values[v, 2]
    return x, y, z


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _logistic_tail(x):  # type: ignore[no-untyped-def]
    """Approximate b, where 1 / (1 + b) is the fraction of a normal distribution above −x."""
    if x > _FULLY_ABOVE:
        return np.float32(0)
    return math.exp(np.float32(-1.702) * max(x, np.float32(-20)))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _lobe_radiance(mirror_data, lattice_node, weight, direction, outward, lobe, n, light):  # type: ignore[no-untyped-def]
    """Compute the incident radiance in the reflection lobe of a pixel.

    Args:
        mirror_data, lattice_node, weight, direction, lobe: see `shade_pixels`; of the pixel.
        outward: normal of its face, which may differ from the shading normal `n`.
        light: written, radiance. (3,)
    Returns:
        Row of the lobe's albedo table, and the fraction toward the next.
    """
    visibility = blend(mirror_data.lobe_visibility, lattice_node, weight)
    row, fraction, lobe_direction, sigma_1 = evaluate_lobe(mirror_data.lobes, lobe, n, direction)
    view_cosine = direction[0] * outward[0] + direction[1] * outward[1] + direction[2] * outward[2]
    lobe_cosine = (lobe_direction[0] * outward[0] + lobe_direction[1] * outward[1] + lobe_direction[2] * outward[2]) * (
        np.float32(-1) if view_cosine > 0 else np.float32(1)
    )
    # nodes store the visibility along the lobe of their own normal; a perturbed lobe may point into its own surface
    inverse_sigma = np.float32(1) / sigma_1
    lobe_tail, mirror_tail = (
        _logistic_tail(inverse_sigma * lobe_cosine),
        _logistic_tail(inverse_sigma * abs(view_cosine)),
    )
    above_fraction = min((np.float32(1) + mirror_tail) / (np.float32(1) + lobe_tail), np.float32(1))
    light[0] = light[1] = light[2] = 0
    direction_1, direction_2, weight_1, sigma_2 = lobe_direction, lobe_direction, np.float32(1), sigma_1
    if mirror_data.is_fine or mirror_data.lobes.is_two[lobe]:
        row, fraction, direction_1, direction_2, weight_1, sigma_1, sigma_2 = evaluate_two_lobes(
            mirror_data.lobes, lobe, n, direction
        )
    for k in range(2):
        lobe_weight = weight_1 if k == 0 else np.float32(1) - weight_1
        if lobe_weight > 0:
            lobe_axis, width = (direction_1, sigma_1) if k == 0 else (direction_2, sigma_2)
            add_environment_in_lobe(
                mirror_data.environment, visibility, lobe_axis, width, above_fraction * lobe_weight, light
            )
    for channel in range(3):
        light[channel] *= mirror_data.environment.gain[channel]
    return row, fraction


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _albedo(lobes, lobe, row, fraction, group):  # type: ignore[no-untyped-def]
    """Return the albedo of a lobe in a group of terms, three numbers; row, fraction: from `_lobe_radiance`."""
    lower, upper = lobes.albedo[lobe, row, group], lobes.albedo[lobe, row + 1, group]
    return (
        lower[0] + fraction * (upper[0] - lower[0]),
        lower[1] + fraction * (upper[1] - lower[1]),
        lower[2] + fraction * (upper[2] - lower[2]),
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _gradient_term(gradients, lattice_node, weight, direction, n):  # type: ignore[no-untyped-def]
    """Return the change of incident luminance between the pixel's lobe and the interpolated ones, for unit albedo.

    Args:
        gradients: gradients of all nodes. (nodes, 4).
        lattice_node, weight, direction: lattice node, weight and direction of the pixel, see `shade_pixels`.
        n: interpolated normal, before normal mapping.
    """
    x, y, z = blend(gradients, lattice_node, weight)
    probe_term = np.float32(0)
    for k in range(3):
        probe_term += weight[k] * gradients[lattice_node[k], 3]
    twice = np.float32(2) * (direction[0] * n[0] + direction[1] * n[1] + direction[2] * n[2])
    rx, ry, rz = direction[0] - twice * n[0], direction[1] - twice * n[1], direction[2] - twice * n[2]
    return np.float32(0.5) * (x * rx + y * ry + z * rz - probe_term)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def interpolate_uv(uvs, corners, uv):  # type: ignore[no-untyped-def]
    """Return the texture coordinates of a point in a triangle.

    Args:
        uvs: UV coordinates of all corners. (corners, 2). corners: the triangle's three, a tuple.
        uv: barycentric, of the last two
            corners.
    """
    a, b, c = corners
    w0, w1, w2 = np.float32(1) - uv[0] - uv[1], uv[0], uv[1]
    return w0 * uvs[a, 0] + w1 * uvs[b, 0] + w2 * uvs[c, 0], w0 * uvs[a, 1] + w1 * uvs[b, 1] + w2 * uvs[c, 1]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def texture_footprint(distance, pixel_angle, uv_scale, cosine):  # type: ignore[no-untyped-def]
    """Return the side of a pixel's footprint in a texture.

    Args:
        distance: to the camera, meters. pixel_angle: angle of a pixel, radians.
        uv_scale: texture units per meter of the surface. cosine: cosine of the view angle, of either sign.
    """
    return distance * pixel_angle * uv_scale / math.sqrt(max(abs(cosine), _MIN_SLANT))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def perturbed_normal(  # type: ignore[no-untyped-def]
    textures, texture, texture_uv, footprint, tangents, corners, uv, n, outward, is_back_face, scratch
):
    """Apply the normal map to the normal n of a pixel.

    Args:
        textures, texture, texture_uv, footprint, scratch: see `normal_tilt`. tangents: of all corners.
        corners: the triangle's three, a tuple. uv: barycentric, of the last two corners. n: interpolated normal.
        outward: normal of the face. is_back_face: the ray hits its back.
    """
    a, b, c = corners
    w0, w1, w2 = np.float32(1) - uv[0] - uv[1], uv[0], uv[1]
    side = np.float32(-1) if is_back_face else np.float32(1)
    t = (
        w0 * tangents[a, 0] + w1 * tangents[b, 0] + w2 * tangents[c, 0],
        w0 * tangents[a, 1] + w1 * tangents[b, 1] + w2 * tangents[c, 1],
        w0 * tangents[a, 2] + w1 * tangents[b, 2] + w2 * tangents[c, 2],
    )
    out = side * outward[0], side * outward[1], side * outward[2]
    return normal_tilt(textures, texture, texture_uv, footprint, n, t, tangents[a, 3], out, scratch)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _shade_pixels(scene, pixel_angle, gbuffer, probes, emission, mirror_data, rows, start, stop, out):  # type: ignore[no-untyped-def]
    """Sum the radiance of nodes and lobes, and emission, along rays rows[start:stop]."""
    textures, uvs, tangents, faces, uv_faces, face_material, face_normal, uv_scale, normals, is_two_sided = scene
    (face, uv, distance), directions, _, lattice_node, weight, _, _, _ = gbuffer
    node_radiance, is_reflective, light_gradient = probes
    lobes = mirror_data.lobes
    texture_value, light, radiance = np.empty(3, np.float32), np.empty(3, np.float32), np.empty(3, np.float32)
    for r in range(start, stop):
        p = rows[r]
        f = face[p]
        if f < 0:
            out[p, 0] = out[p, 1] = out[p, 2] = 0
            continue
        material = face_material[f]
        # tuples, and inlined helpers: arrays handed over would be counted as references, several times a ray
        outward = face_normal[f, 0], face_normal[f, 1], face_normal[f, 2]
        corners = faces[f, 0], faces[f, 1], faces[f, 2]
        nodes, weights = (
            (lattice_node[p, 0], lattice_node[p, 1], lattice_node[p, 2]),
            (weight[p, 0], weight[p, 1], weight[p, 2]),
        )
        barycentric = uv[p, 0], uv[p, 1]
        lobe, row, fraction, ratio = lobes.lobe_index[material], 0, np.float32(0), np.float32(1)
        d = directions[p, 0], directions[p, 1], directions[p, 2]
        view_cosine = outward[0] * d[0] + outward[1] * d[1] + outward[2] * d[2]
        footprint = texture_footprint(distance[p], pixel_angle, uv_scale[f], view_cosine)
        texture_uv = interpolate_uv(uvs, (uv_faces[f, 0], uv_faces[f, 1], uv_faces[f, 2]), barycentric)
        is_mapped = textures.material_textures[material, NORMAL_MAP] >= 0
        n, gradient_term = d, np.float32(0)
        if is_mapped or lobe >= 0:
            n = normalize(blend(normals, nodes, weights))
        if lobe >= 0:
            gradient_term = _gradient_term(mirror_data.gradients, nodes, weights, d, n)
        if is_mapped:
            perturbed = perturbed_normal(
                textures, textures.material_textures[material, NORMAL_MAP], texture_uv, footprint, tangents, corners,
                barycentric,
                n, outward, view_cosine > 0, texture_value,
            )  # fmt: skip
            ratio = shading_ratio(blend(light_gradient, nodes, weights), n, perturbed)
            n = perturbed
        if lobe >= 0:
            row, fraction = _lobe_radiance(mirror_data, nodes, weights, d, outward, lobe, n, light)
        # by element: assigning a slice is a call
        texture_value[0] = texture_value[1] = texture_value[2] = 1
        if textures.material_textures[material, EMISSION] >= 0:
            image = textures.material_textures[material, EMISSION]
            sample_texture(textures, image, texture_uv[0], texture_uv[1], footprint, texture_value)
        for channel in range(3):
            is_emissive = view_cosine < 0 or is_two_sided[material]
            out[p, channel] = emission[material, channel] * texture_value[channel] if is_emissive else np.float32(0)
        for group in range(NUM_GROUPS):
            if not is_reflective[material, group]:
                continue
            texture_value[0] = texture_value[1] = texture_value[2] = 1
            texture = textures.material_textures[material, group - 1] if group else -1
            if texture >= 0:
                sample_texture(textures, texture, texture_uv[0], texture_uv[1], footprint, texture_value)
            albedo = np.float32(0), np.float32(0), np.float32(0)
            if lobe >= 0:
                albedo = _albedo(lobes, lobe, row, fraction, group)
            for channel in range(3):
                total = np.float32(0)
                for k in range(3):
                    total += weights[k] * node_radiance[nodes[k], group, channel]
                total *= ratio
                if lobe >= 0:
                    lobe_radiance = albedo[channel] * light[channel]
                    total = max(total, -_MAX_NEGATIVE_RATIO * lobe_radiance) + lobe_radiance
                radiance[channel] = max(total, np.float32(0))
            gain = np.float32(1)
            if gradient_term != 0:
                luminance = _RED * radiance[0] + _GREEN * radiance[1] + _BLUE * radiance[2]
                delta = gradient_term * (_RED * albedo[0] + _GREEN * albedo[1] + _BLUE * albedo[2])
                delta = min(max(delta, -_MAX_GRADIENT_RATIO * luminance), _MAX_GRADIENT_RATIO * luminance)
                gain += delta / max(luminance, np.float32(1e-20))
            for channel in range(3):
                out[p, channel] += texture_value[channel] * gain * radiance[channel]


class InterpolatedProbes(NamedTuple):
    """Radiance reflected toward the camera at lattice nodes.

    Attributes:
        radiance: untextured, then of each of `TEXTURES`.
        is_reflective: True if a material reflects anything in a group, lobes included.
        light_gradient: from `relume.live.free_camera.normal_mapping`; empty if no material has a normal map.
    """

    radiance: Shaped[F32, "nodes groups 3"]
    is_reflective: Shaped[NDArray[np.bool_], "materials groups"]
    light_gradient: Shaped[F32, "nodes_or_none 3"]


def shade_pixels(
    stored_scene: StoredScene,
    gbuffer: GBuffer,
    pixel_angle: float,
    interpolated_probes: InterpolatedProbes,
    emission: Shaped[F32, "materials 3"],
    mirror_data: MirrorData,
    rows: Shaped[NDArray[np.int32], " n"] | None = None,
    out: Shaped[F32, "rays 3"] | None = None,
) -> Shaped[F32, "rays 3"]:
    """Compute the radiance along rays; zero for rays that miss.

    Args:
        stored_scene: that is hit. gbuffer: G-buffer of the rays. pixel_angle: angle of a pixel, radians.
        interpolated_probes: at all lattice nodes. emission: mean emitted radiance of each material.
        mirror_data: radiance of lobes, added. rows: rays to shade; None: all. out: written; None: a new array.
    """
    radiance = np.empty((len(gbuffer.directions), 3), np.float32) if out is None else out
    ray_indices = np.arange(len(radiance), dtype=np.int32) if rows is None else rows
    scene_args = stored_scene.pixel_arrays(), np.float32(pixel_angle), gbuffer
    args = *scene_args, interpolated_probes, emission, mirror_data, ray_indices
    parallel_for_chunks(
        lambda start, stop: _shade_pixels(*args, start, stop, radiance), len(ray_indices), _CHUNKS_PER_THREAD
    )
    return radiance
