"""Light along rays that were drawn from the lobe of a term: from patches, and from the texels of the environment.

The light of the environment has two estimators: lobe rays, and its triangles with one visibility bit each. A bright
triangle that few rays of a lobe meet would be noise in the first; a triangle that is wide beside the lobe would show
its outline in the second. So each triangle m is shared out at each point,

    t = 1 / (1 + (n / 8)²),   n = N p(ω) Ω_m,

the share t to the triangle and the rest to the rays that meet it. n is the number of rays that are expected in it, p
their density at the direction of the triangle that is nearest to the lobe's peak. Both estimators use the same t, so
the sum is the light whatever t is (multiple importance sampling, Veach 1995).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.angles import angle_at
from relume.core.numba_options import NO_REFCOUNT
from relume.lights.spherical_triangles import TriangleLights
from relume.math.fast_math import acos_clamped, azimuth_fraction
from relume.math.rgb9e5 import unpack_rgb9e5
from relume.patches.patch_kdtree import NO_PATCH
from relume.raytrace.lobe_directions import (
    LobePattern,
    lobe_density,
    lobe_ray,
    lobe_shift,
    lobe_vector,
    mirrored_axis,
    ray_jitter,
)
from relume.transport.gather_kernel import in_frame
from relume.transport.hit_textures import TexturedLight
from relume.transport.light_culling import ListedLights, half_angle_reach
from relume.transport.lobe_hits import LobeHits, half_vector_spread, lobe_ray_in_pixel
from relume.transport.lobe_paths import ESCAPE, REFLECTION, TRANSMISSION, LobeSurfaces
from relume.transport.outgoing_patch_light import OutgoingLight, bin_of
from relume.transport.shading_points import ListedRays, ShadingPoints

F32 = NDArray[np.float32]

_ZERO, _HALF, _ONE, _TWO = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2)
_PER_PI = np.float32(1 / math.pi)
_PER_ENOUGH_RAYS = np.float32(1 / 8)
_LEAST_SHARE = np.float32(1e-4)


class LobeEnvironment(NamedTuple):
    """The environment as lobe rays see it.

    Attributes:
        radiance: equirectangular map, top row first, times its gain; empty for no light.
        tile: triangle of each texel, −1 if it does not share its light with rays.
        rotation: cosine and sine of the map's rotation about +Y.
        direction, radius, solid_angle: of the triangles that share their light.
        texels, levels: the map without its peaks, at halved sizes down to one row; begin, height and width of each.
        is_direct: rays that leave the scene at once bring its light; others always do.
    """

    radiance: Shaped[F32, "height width 3"]
    tile: Shaped[NDArray[np.int32], "height width"]
    rotation: Shaped[F32, " 2"]
    direction: Shaped[F32, "M 3"]
    radius: Shaped[F32, " M"]
    solid_angle: Shaped[F32, " M"]
    texels: Shaped[F32, "texels 3"]
    levels: Shaped[NDArray[np.int64], "levels 3"]
    is_direct: bool


NO_ENVIRONMENT = LobeEnvironment(
    radiance=np.empty((0, 0, 3), np.float32),
    tile=np.empty((0, 0), np.int32),
    rotation=np.array([1, 0], np.float32),
    direction=np.empty((0, 3), np.float32),
    radius=np.empty(0, np.float32),
    solid_angle=np.empty(0, np.float32),
    texels=np.empty((0, 3), np.float32),
    levels=np.empty((0, 3), np.int64),
    is_direct=False,
)


class LobePeaks(NamedTuple):
    """Peaks of the environment, which light wide lobes that lobe rays meet.

    Attributes:
        direction: unit. irradiance: on a surface perpendicular to it, of the light above the limit of the map.
        visible: fraction of each patch's points that see it; zero in row `NO_PATCH`.
    """

    direction: Shaped[F32, "K 3"]
    irradiance: Shaped[F32, "K 3"]
    visible: Shaped[F32, "patches K"]


NO_EMISSION = np.empty((0, 3), np.float32)
NO_PEAKS = LobePeaks(np.empty((0, 3), np.float32), np.empty((0, 3), np.float32), np.empty((0, 0), np.float32))


@dataclass(frozen=True)
class LobeRays:
    """Rays of the lobe of a term; a `relume.transport.shading_points.RayList`.

    Attributes:
        hits: what each ray meets. pattern: ray directions, shifted by the points' seeds.
        outgoing: outgoing radiance of the patches. textured: its isotropic part, by the textures at a hit.
        environment: light of the rays that leave the scene.
        broad_share: share of each patch's isotropic radiance that its narrow lobe does not reflect.
        footprint: of each point, see `trace_lobe_rays`.
        surfaces: that rays go on from. peaks: of the environment.
        emission: radiance of each material's surfaces, which surfaces with narrow lobes reflect; empty for none.
    """

    hits: LobeHits
    pattern: LobePattern
    outgoing: OutgoingLight
    textured: TexturedLight
    environment: LobeEnvironment
    broad_share: Shaped[F32, " patches"]
    footprint: Shaped[F32, "#n 2 2 3"]
    surfaces: LobeSurfaces
    peaks: LobePeaks
    emission: Shaped[F32, "materials 3"]

    @property
    def max_rays_per_point(self) -> int:
        """Maximum number of rays of a point."""
        return self.pattern.num_rays

    def unshared(self, rows: Shaped[NDArray[np.integer], " m"]) -> LobeRays:
        """Select the rays of some points; see `RayList`."""
        footprint = self.footprint if len(self.footprint) == 1 else self.footprint[rows]
        return replace(self, hits=self.hits.rows(rows), footprint=footprint)

    def list_into(self, listed: ListedRays, receivers: ShadingPoints, start: int, stop: int) -> int:
        """List the rays of `receivers` [start, stop) into `listed`; see `RayList`."""
        r, point_args = receivers, (self.footprint, _levels(receivers))
        light_args = (
            (self.outgoing, self.textured),
            self.broad_share,
            self.environment,
            self.surfaces,
            self.peaks,
            self.emission,
        )
        hits = self.hits.patch, self.hits.escapes, self.hits.texture, self.hits.paths
        return int(_list_lobe_rays(r.points, r.wo, *point_args, hits, self.pattern, light_args, start, stop, listed))

    def share_triangles(
        self, lights: TriangleLights, receivers: ShadingPoints, start: int, num: int, listed: ListedLights, shading: F32
    ) -> None:
        """Multiply listed triangles by their share t, in place.

        Args:
            lights: the triangles. receivers: all points. start, num: the points of the list.
            listed: entries. shading: of each entry. (1 or 3, K)
        """
        light_args = lights.radius, self.environment.solid_angle
        _share_triangles(self.pattern, self.footprint, _levels(receivers), *light_args, start, num, listed, shading)


def _levels(receivers: ShadingPoints) -> NDArray[np.uint8]:
    """Return the roughness levels of points, or one for all."""
    return np.zeros(1, np.uint8) if receivers.level is None else receivers.level


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _triangle_share(pattern, level, radius, solid_angle, spread, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Share t of a triangle at a point.

    Args:
        pattern, level: of the point. radius, solid_angle: of the triangle. spread: from `half_vector_spread`.
        ix, iy, iz: local direction of the triangle. ox, oy, oz: local wo.
    """
    if pattern.is_half_angle:
        reach, cos_theta_d = half_angle_reach(radius, ix, iy, iz, ox, oy, oz)
        reach += spread
    else:
        reach, cos_theta_d = radius + _TWO * spread, _ONE
        ox, oy, oz = mirrored_axis(pattern, ox, oy, oz)
    band = 0
    for k in range(pattern.angles.shape[0]):
        angle = angle_at(pattern.angles[k], ix, iy, iz, ox, oy, oz) - reach
        nearest = min(int(pattern.scale * max(angle, _ZERO)), pattern.band_density.shape[1] - 1)
        band = band * pattern.band_density.shape[1] + nearest
    ratio = _PER_ENOUGH_RAYS * solid_angle * lobe_density(pattern, level, band, cos_theta_d)
    share = _ONE / (_ONE + ratio * ratio)
    return share if share > _LEAST_SHARE else _ZERO


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _share_triangles(pattern, footprint, level, radius, solid_angle, start, num, listed, shading):  # type: ignore[no-untyped-def]
    """Multiply listed triangles by their share; see `LobeRays.share_triangles`."""
    wi, wo = listed.wi, listed.wo
    for row in range(num):
        point_level, spread = level[min(start + row, level.shape[0] - 1)], half_vector_spread(footprint, start + row)
        if not pattern.is_narrow[point_level]:
            continue
        for entry in range(listed.first[row], listed.first[row + 1]):
            light = listed.light[entry]
            share = _triangle_share(
                pattern, point_level, radius[light], solid_angle[light], spread,
                wi[0, entry], wi[1, entry], wi[2, entry], wo[0, entry], wo[1, entry], wo[2, entry],
            )  # fmt: skip
            for channel in range(shading.shape[0]):
                shading[channel, entry] *= share


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _texel(rotation, height, width, world, jitter):  # type: ignore[no-untyped-def]
    """Return row and column of the texel in a world direction.

    With a uniform jitter in [0, 1)², the mean over rays is the bilinear interpolation between the centers of texels.
    """
    cosine, sine, (dx, dy, dz) = rotation[0], rotation[1], world
    x, z = dx * cosine - dz * sine, dx * sine + dz * cosine
    u = azimuth_fraction(x, z) + _HALF
    polar = acos_clamped(abs(dy)) * _PER_PI
    v = polar if dy >= 0 else _ONE - polar
    row, column = v * np.float32(height) + jitter[1] - _HALF, u * np.float32(width) + jitter[0] - _HALF
    return min(max(math.floor(row), 0), height - 1), (math.floor(column) + width) % width


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _from_environment(environment, pattern, level, spread, frame, world, jitter, o):  # type: ignore[no-untyped-def]
    """Radiance of the environment along a ray, less the share of the triangle that it meets.

    Args:
        spread: from `half_vector_spread`. frame: tangent, bitangent and normal of the point.
        world: world-space direction of the ray.
        jitter: see `_texel`. o: local wo.
    """
    t, b, n = frame
    height, width = environment.tile.shape
    row, column = _texel(environment.rotation, height, width, world, jitter)
    tile, texel = environment.tile[row, column], environment.radiance[row, column]
    if tile < 0:
        return texel[0], texel[1], texel[2]
    d = environment.direction[tile]
    share = _triangle_share(
        pattern, level, environment.radius[tile], environment.solid_angle[tile], spread,
        t[0] * d[0] + t[1] * d[1] + t[2] * d[2],
        b[0] * d[0] + b[1] * d[1] + b[2] * d[2],
        n[0] * d[0] + n[1] * d[1] + n[2] * d[2],
        o[0], o[1], o[2],
    )  # fmt: skip
    rest = _ONE - share
    return rest * texel[0], rest * texel[1], rest * texel[2]


@nb.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def texels_at(textured, texture):  # type: ignore[no-untyped-def]
    """Diffuse and specular texture at a hit, two tuples. texture: packed, of its slots"""
    diffuse = specular = _ONE, _ONE, _ONE
    if textured.diffuse >= 0:
        diffuse = unpack_rgb9e5(texture[textured.diffuse])
    if textured.specular >= 0:
        specular = unpack_rgb9e5(texture[textured.specular])
    return diffuse, specular


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def isotropic_at(textured, patch, texels):  # type: ignore[no-untyped-def]
    """Isotropic radiance of a patch at a point of it.

    Args:
        textured: `TexturedLight`. patch: index. texels: from `texels_at`.
    """
    (r, g, b), (s, t, u) = texels
    plain, diffuse, specular = textured.plain[patch], textured.by_diffuse[patch], textured.by_specular[patch]
    return (
        plain[0] + diffuse[0] * r + specular[0] * s,
        plain[1] + diffuse[1] * g + specular[1] * t,
        plain[2] + diffuse[2] * b + specular[2] * u,
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _add_directional(textured, patch, channel, texels, directional):  # type: ignore[no-untyped-def]
    """Radiance of a patch in one channel, isotropic and directional.

    A low degree rings, and a texture can be many times its mean: the light that rings belong to limits how dark they
    are. That is the light of the textured highlights, or all light if highlights have no texture.

    Args:
        textured, patch, texels: as in `from_patch`. channel: index.
        directional: radiance of the directional part, without the texture.
    """
    diffuse, specular = texels[0][channel], texels[1][channel]
    even = textured.plain[patch, channel] + textured.by_diffuse[patch, channel] * diffuse
    highlight = textured.by_specular[patch, channel] * specular
    least = _ZERO if highlight > 0 else -even
    return even + max(highlight + specular * textured.per_specular[patch, channel] * directional, least)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def from_patch(outgoing, textured, patch, texels, world):  # type: ignore[no-untyped-def]
    """Radiance of a patch at a point of it.

    Args:
        outgoing, textured: of `LobeRays`. patch: index. texels: from `texels_at`.
        world: direction toward the patch, world space.
    """
    row = outgoing.lobe[patch] if outgoing.smooth.shape[0] > 0 else -1
    if row < 0:
        return isotropic_at(textured, patch, texels)
    bin_index = bin_of(outgoing.frame, row, -world[0], -world[1], -world[2])
    scale, steps = outgoing.scale[row], outgoing.smooth[row, bin_index]
    return (
        _add_directional(textured, patch, 0, texels, scale[0] * steps[0]),
        _add_directional(textured, patch, 1, texels, scale[1] * steps[1]),
        _add_directional(textured, patch, 2, texels, scale[2] * steps[2]),
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _environment_behind(environment, blur, world):  # type: ignore[no-untyped-def]
    """Radiance of the environment behind a lobe: its texel, or behind a wide lobe a blurred texel without peaks.

    Args:
        blur: of `LobeSurfaces`. world: world-space direction.
    """
    height, width = environment.tile.shape
    if blur == 0:
        row, column = _texel(environment.rotation, height, width, world, (_HALF, _HALF))
        texel = environment.radiance[row, column]
        return texel[0], texel[1], texel[2]
    texels = blur * _TWO * np.float32(height) * _PER_PI
    level = min(int(math.log2(max(texels, _ONE))), environment.levels.shape[0] - 1)
    begin, rows, columns = environment.levels[level, 0], environment.levels[level, 1], environment.levels[level, 2]
    row, column = _texel(environment.rotation, rows, columns, world, (_HALF, _HALF))
    index = begin + row * columns + column
    return environment.texels[index, 0], environment.texels[index, 1], environment.texels[index, 2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _from_peaks(peaks, surfaces, lobe, patch, n, o):  # type: ignore[no-untyped-def]
    """Light of the peaks that a lobe reflects, by its density: the albedo is in the throughput.

    Args:
        lobe: row in `LobeSurfaces`. patch: where the peaks may be visible. n, o: normal and wo, world space.
    """
    red = green = blue = _ZERO
    mirrored = _TWO * (n[0] * o[0] + n[1] * o[1] + n[2] * o[2])
    for k in range(peaks.direction.shape[0]):
        visible, d = peaks.visible[patch, k], peaks.direction[k]
        if visible == 0 or n[0] * d[0] + n[1] * d[1] + n[2] * d[2] <= 0:
            continue
        if surfaces.is_half_angle[lobe]:
            hx, hy, hz = d[0] + o[0], d[1] + o[1], d[2] + o[2]
            length = np.float32(math.sqrt(hx * hx + hy * hy + hz * hz)) + np.float32(1e-6)
            angle, jacobian = acos_clamped((n[0] * hx + n[1] * hy + n[2] * hz) / length), _HALF / length
        else:
            cosine = d[0] * (mirrored * n[0] - o[0]) + d[1] * (mirrored * n[1] - o[1]) + d[2] * (mirrored * n[2] - o[2])
            angle, jacobian = acos_clamped(cosine), _ONE
        band = min(int(surfaces.scale[lobe] * angle), surfaces.band_density.shape[1] - 1)
        density = visible * jacobian * surfaces.band_density[lobe, band]
        red += density * peaks.irradiance[k, 0]
        green += density * peaks.irradiance[k, 1]
        blue += density * peaks.irradiance[k, 2]
    return red, green, blue


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _along_path(paths, first, last, patches, environment, surfaces, peaks, emission, direct):  # type: ignore[no-untyped-def]
    """Radiance that the entries [first, last) of a path bring to its ray.

    Args:
        patches: outgoing and textured light of `LobeRays`. emission: of `LobeRays`.
        direct: radiance of the environment along the ray.
    """
    outgoing, textured = patches
    red = green = blue = _ZERO
    for entry in range(first, last):
        kind, patch, lobe, d = paths.kind[entry], paths.patch[entry], paths.lobe[entry], paths.direction[entry]
        light, direction = (_ZERO, _ZERO, _ZERO), (d[0], d[1], d[2])
        if kind == REFLECTION:
            if peaks.direction.shape[0] > 0:
                n = paths.normal[entry]
                light = _from_peaks(peaks, surfaces, lobe, patch, (n[0], n[1], n[2]), direction)
        elif kind == ESCAPE:
            if environment.radiance.shape[0] > 0:
                light = _environment_behind(environment, surfaces.blur[lobe], direction)
        elif kind == TRANSMISSION:
            light = direct
        elif patch != NO_PATCH:
            light = from_patch(outgoing, textured, patch, texels_at(textured, paths.texture[entry]), direction)
        emitter = paths.emitter[entry]
        if emitter < emission.shape[0]:
            image = unpack_rgb9e5(paths.emission[entry])
            light = (
                light[0] + emission[emitter, 0] * image[0],
                light[1] + emission[emitter, 1] * image[1],
                light[2] + emission[emitter, 2] * image[2],
            )
        red += paths.throughput[entry, 0] * light[0]
        green += paths.throughput[entry, 1] * light[1]
        blue += paths.throughput[entry, 2] * light[2]
    return red, green, blue


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _list_lobe_rays(points, wo, footprint, level, hits, pattern, light_args, start, stop, listed):  # type: ignore[no-untyped-def]
    """List the lobe rays of points [start, stop) that carry light.

    Args:
        points: `SurfacePoints`. wo: view directions. (n, 3) footprint: of `LobeRays`. level: roughness levels, or one.
        hits: the fields of `LobeHits`. pattern: of `LobeRays`.
        light_args: its outgoing and textured, broad_share, environment, surfaces, peaks and emission.
        listed: `ListedRays`, written.
    Returns:
        K, the number of rays.
    """
    (patch, escapes, texture, paths), (patches, broad_share, environment, surfaces, peaks, emission) = hits, light_args
    outgoing, textured = patches
    wi, end, has_environment = listed.wi, 0, environment.radiance.shape[0] > 0
    is_direct = has_environment and environment.is_direct
    for p in range(start, stop):
        listed.first[p - start] = end
        point_level, spread = level[min(p, level.shape[0] - 1)], half_vector_spread(footprint, p)
        if not pattern.is_narrow[point_level]:
            continue
        n, t = points.normal[p], points.tangent[p]
        b, o = in_frame(n, t, wo[p])
        shift, path, last_path = lobe_shift(pattern, points.seed[p]), paths.first[p], paths.first[p + 1]
        for ray in range(patch.shape[1]):
            first_entry = path
            while path < last_path and paths.ray[path] == ray:
                path += 1
            is_path = path > first_entry
            hit, is_escaping = patch[p, ray], (escapes[p, ray >> 3] >> (ray & 7)) & 1
            if (hit == NO_PATCH and not is_escaping and not is_path) or (is_escaping and not is_direct):
                continue
            vector, band = lobe_vector(pattern, point_level, ray, shift)
            (x, y, z), is_valid = lobe_ray(pattern, vector, o[0], o[1], o[2])
            if z <= 0 or not is_valid:
                continue
            world, is_traced = lobe_ray_in_pixel(
                pattern, vector, ray, n, t, wo[p], footprint[min(p, footprint.shape[0] - 1)], points.seed[p]
            )
            if not is_traced:
                continue
            is_passing = is_path and paths.kind[path - 1] == TRANSMISSION
            light = (_ZERO, _ZERO, _ZERO)
            if is_escaping or (is_passing and is_direct):
                jitter = ray_jitter(ray, points.seed[p])
                light = _from_environment(environment, pattern, point_level, spread, (t, b, n), world, jitter, o)
            if is_path:
                light = _along_path(paths, first_entry, path, patches, environment, surfaces, peaks, emission, light)
                red, green, blue = isotropic_at(textured, hit, texels_at(textured, texture[:, p, ray]))
                share = broad_share[hit]
                light = light[0] + share * red, light[1] + share * green, light[2] + share * blue
            elif not is_escaping:
                light = from_patch(outgoing, textured, hit, texels_at(textured, texture[:, p, ray]), world)
            hx, hy, hz = x + o[0], y + o[1], z + o[2]
            cos_theta_d = _HALF * np.float32(math.sqrt(hx * hx + hy * hy + hz * hz))
            weight = z / max(lobe_density(pattern, point_level, band, cos_theta_d), np.float32(1e-20))
            wi[0, end], wi[1, end], wi[2, end] = x, y, z
            listed.wo[0, end], listed.wo[1, end], listed.wo[2, end] = o[0], o[1], o[2]
            for channel in range(3):
                listed.irradiance[channel, end] = weight * light[channel]
            end += 1
    listed.first[stop - start] = end
    return end


def find_lobe_rays(receivers: ShadingPoints) -> LobeRays | None:
    """Return the lobe rays of points; None if they have none."""
    return next((rays for rays in receivers.rays if isinstance(rays, LobeRays)), None)
