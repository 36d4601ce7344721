"""The transfer kernels in plain NumPy and float64: slow, exact where the kernels approximate, and simple."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.assets.environments.equirect import texel_directions, texel_solid_angles
from relume.brdf.curves import curve_bands, curve_values
from relume.brdf.evaluate import angles_numpy
from relume.brdf.lobe_sampling import sample_lobe
from relume.brdf.registry import TERMS
from relume.live.fixed_camera.illumination import illumination_from_look
from relume.live.fixed_camera.protocols import EditAxis
from relume.live.opened.patch_direct_light import DirectPatchLight
from relume.radiosity.highlight_transport import outgoing_in_highlights
from relume.radiosity.solve_bounces import solve_bounces
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.visibility import trace_visibility
from relume.transport.outgoing_patch_light import SIDE
from relume.transport.projector import Projector
from relume.transport.shading_points import ShadingPoints
from relume.transport.term_contraction import contract
from relume.views.view import View


def unit(v):
    """Normalize vectors along the last axis."""
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def make_random_receivers(count, num_lights, seed=0, horizon=0.15):
    """Points with random frames and view directions, from which every light above the horizon is visible."""
    rng = np.random.default_rng(seed)
    normal = unit(rng.normal(size=(count, 3)))
    tangent = unit(np.cross(normal, rng.normal(size=(count, 3))))
    wo = unit(rng.normal(size=(count, 3)))
    facing = np.einsum("nc,nc->n", wo, normal)
    wo = unit(wo + np.where(facing < horizon, horizon - facing + np.abs(facing), 0)[:, None] * normal)
    visible = np.full((count, (num_lights + 7) // 8), 255, np.uint8)
    return make_receivers_at_origin(wo, normal, tangent, visible)


def make_receivers_at_origin(wo, normal, tangent, visible):
    """Receivers with these frames at one position."""
    wo, normal, tangent = (np.ascontiguousarray(a, np.float32) for a in (wo, normal, tangent))
    return ShadingPoints(
        SurfacePoints(np.zeros_like(normal), normal, tangent, np.arange(len(wo), dtype=np.uint32)), wo, visible
    )


def only_above(receivers, lights):
    """Receivers with lights below their horizon hidden."""
    above = receivers.normal @ lights.direction.T > 0
    visible = np.packbits(above, axis=1, bitorder="little")
    return replace(receivers, visible=visible)


def frames(receivers):
    """World-to-local matrices: rows are tangent, bitangent, normal. (n, 3, 3)"""
    normal, tangent = receivers.normal.astype(float), receivers.tangent.astype(float)
    return np.stack([tangent, np.cross(normal, tangent), normal], axis=1)


def visible_lights(receivers, num_lights):
    """(n, M) bool"""
    return np.unpackbits(receivers.visible, axis=1, bitorder="little")[:, :num_lights].astype(bool)


def spherical_area(a, b, c):
    """Solid angle of triangles of unit corners (..., 3) (van Oosterom and Strackee 1983)."""
    volume = np.abs(np.einsum("...c,...c->...", a, np.cross(b, c)))
    dots = 1 + sum(np.einsum("...c,...c->...", u, v) for u, v in ((a, b), (b, c), (c, a)))
    return 2 * np.arctan2(volume, dots)


def pieces(lights, depth):
    """Subdivide each light triangle into 4^depth pieces: centers (M, 4^depth, 3) and fractions of its solid angle."""
    corners = unit(lights.nodes.astype(float).transpose(2, 1, 0))[:, None, :3]
    for _ in range(depth):
        a, b, c = np.moveaxis(corners, 2, 0)
        ab, bc, ca = unit(a + b), unit(b + c), unit(c + a)
        children = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        corners = np.concatenate([np.stack(child, axis=2) for child in children], axis=1)
    area = spherical_area(*np.moveaxis(corners, 2, 0))
    return unit(corners.mean(axis=2)), area / area.sum(axis=1, keepdims=True)


def shade_pieces(term, lights, receivers, row, light_pieces):
    """Light of one receiver by pieces: q cos θi · power (K, 3), fractions (K, P), local wi (K, P, 3), wo.

    light_pieces: from `pieces`.
    """
    visible = np.nonzero(visible_lights(receivers, lights.num_lights)[row])[0]
    frame = frames(receivers)[row]
    wo = frame @ receivers.wo[row].astype(float)
    wi = lights.direction[visible].astype(float) @ frame.T
    shading = term.quotients(*wi.T, *(np.full(len(visible), o) for o in wo)).T * wi[:, 2:]
    centers, fractions = light_pieces
    return lights.irradiance[visible].astype(float) * shading, fractions[visible], centers[visible] @ frame.T, wo


def project(term, bands, active, lights, receivers, depth=5):
    """Reference of `Projector.project` with the exact angle of every piece and the mean of products of curves.

    Returns:
        (n, J, 3) float64
    """
    num_bands = term.curve(active).num_bands if active else 1
    out = np.zeros((len(receivers.normal), num_bands, 3))
    light_pieces = pieces(lights, depth)
    for row in range(len(out)):
        power, fractions, wi, wo = shade_pieces(term, lights, receivers, row, light_pieces)
        weight = power[:, None, :] * fractions[..., None]
        band = np.zeros(fractions.shape, int)
        for curve in term.curves:
            if curve.depends_on_view:
                continue
            curve_band = find_bands(curve, wi, wo)
            if curve.name == active:
                band = curve_band
            else:
                weight = weight * np.moveaxis(bands[curve.name][:, curve_band], 0, -1)
        for c in range(3):
            out[row, :, c] = np.bincount(band.ravel(), weight[..., c].ravel(), num_bands)
    return out


def find_bands(curve, wi, wo):
    """Band of the exact angle of each pair of directions."""
    gamma = angles_numpy(curve.angle, wi, np.broadcast_to(wo, wi.shape), curve.axes)
    return np.minimum((gamma * curve.num_bands / (np.pi / 2)).astype(int), curve.num_bands - 1)


def project_point_lights(term, bands, lights, receivers):
    """The environment as points: all power of a light in its direction and in the band of its angle. (n, 3)"""
    out = np.zeros((len(receivers.normal), 3))
    whole = pieces(lights, 0)
    for row in range(len(out)):
        power, _, _, wo = shade_pieces(term, lights, receivers, row, whole)
        visible = visible_lights(receivers, lights.num_lights)[row]
        wi = lights.direction[visible].astype(float) @ frames(receivers)[row].T
        for curve in term.curves:
            if not curve.depends_on_view:
                power = power * bands[curve.name][:, find_bands(curve, wi, wo)].T
        out[row] = power.sum(axis=0)
    return out


def integrate_texels(document, radiance, receivers, visible=None):
    """The reflection integral of one term over all texels at exact angles. visible: (n, texels) bool. (n, 3)"""
    term = TERMS[document["model"]].normalized(document)
    height, width, _ = radiance.shape
    directions = texel_directions(height, width).reshape(-1, 3).astype(float)
    power = (radiance * texel_solid_angles(height, width)[:, None, None]).reshape(-1, 3)
    out = np.zeros((len(receivers.normal), 3))
    for row, frame in enumerate(frames(receivers)):
        wi, wo = directions @ frame.T, frame @ receivers.wo[row].astype(float)
        above = wi[:, 2] > 0
        if visible is not None:
            above &= visible[row]
        wi = wi[above]
        weight = power[above] * term.quotients(*wi.T, *(np.full(len(wi), o) for o in wo)).T * wi[:, 2:]
        for curve in term.curves:
            if not curve.depends_on_view:
                gamma = angles_numpy(curve.angle, wi, np.broadcast_to(wo, wi.shape), curve.axes)
                weight = weight * curve_values(document, curve, gamma).T
        out[row] = weight.sum(axis=0)
    return out


def stream(transport, change, image):
    """Image + T · Δc. transport (tiles, 3, J, samples), change (3, J), image (tiles, 3, samples)"""
    return image + np.einsum("tcjs,cj->tcs", transport.astype(float), change)


def gather_incident_light(transfer, view: View, index, look):
    """All light of a look at a material's samples: triangles and receivers, all sources summed at once."""
    light = illumination_from_look(look, transfer.material_names, has_bounces=EditAxis.BOUNCES in transfer.axes)
    gain = np.array(look.environment.gain, np.float32)
    if EditAxis.LIGHT not in transfer.axes:  # a method with its own light
        samples = transfer.samples(view, index, transfer.cache)
        return transfer.incident_light(samples, light._replace(environment_gain=look.environment.gain))
    lights, receivers = trace_environment(transfer, view, index, look.environment.key)
    indirect = None
    if light.paths.has_indirect:
        reflecting = transfer.patches.reflectance_operator(light.reflectances)
        patch_light = DirectPatchLight(
            transfer.patches,
            transfer.local,
            transfer.environment_lights,
            transfer.cache,
            transfer.key,
            transfer.harmonic,
        )
        scaled_light = light._replace(environment_gain=look.environment.gain)
        incident = patch_light.incident_light(scaled_light, reflecting, is_preview=False)
        patch_lobes = transfer.patches.highlight_tables(light.reflectances, reflecting)
        lobe_light = (
            patch_lobes,
            outgoing_in_highlights(
                transfer.patches, patch_lobes, patch_light.direct(scaled_light, patch_lobes.rows, is_preview=False)
            ),
        )
        bounces = light.paths.first, light.paths.last
        indirect = solve_bounces(transfer.patches, reflecting, incident, *bounces, lobe_light).outgoing_light(
            transfer.patches
        )
    local = transfer.local.rays_to(light, view.surface_points(index))
    direct_lights = replace(lights, irradiance=lights.irradiance * gain) if light.paths.direct else lights.empty()
    gather_rays = () if indirect is None else (replace(view.gather_rays(index), outgoing=indirect),)
    return direct_lights, replace(receivers, rays=(*gather_rays, *local))


def trace_environment(transfer, view: View, index, environment):
    """Triangles of an environment and a material's samples: what the bake lacks is traced ray by ray."""
    receivers, (_, lights, unbaked) = view.receivers(index), transfer.refined.exact(environment)
    points, directions = receivers.points, lights.direction[unbaked]
    ray_args = transfer.local.embree, points.position, points.normal, directions, points.alpha_sample
    bits = np.zeros((points.num_points, lights.num_lights), np.uint8)
    baked = np.unpackbits(receivers.visible, axis=1, count=transfer.lights.num_lights, bitorder="little")
    bits[:, : baked.shape[1]] = baked
    traced = trace_visibility(*ray_args).visible
    bits[:, unbaked] = np.unpackbits(traced, axis=1, count=len(unbaked), bitorder="little")
    return lights, replace(receivers, visible=np.packbits(bits, axis=1, bitorder="little"))


def trace_lobe_light(transfer, view: View, index, look, lobe):
    """All light of a look at a material's samples along a narrow lobe, tested in tests/transport/test_lobe_rays.py."""
    light = illumination_from_look(look, transfer.material_names, has_bounces=EditAxis.BOUNCES in transfer.axes)
    samples = transfer.samples(view, index, transfer.cache)
    return transfer.incident_light(samples, light._replace(environment_gain=look.environment.gain), lobe=lobe)


def evaluate_outgoing(outgoing, patch, direction, *, is_narrow=False):
    """Outgoing radiance of a patch in a unit direction, world space; for narrow lobes without direction rings. (3,)"""
    radiance, row = outgoing.isotropic[patch].astype(float), outgoing.lobe[patch]
    if row >= 0:
        x, y = outgoing.frame[row].astype(float) @ direction
        disk_point = np.array([x, y]) / (1 + np.sqrt(max(0.0, 1 - x * x - y * y)))
        across, along = np.clip(np.floor((disk_point + 1) * SIDE / 2), 0, SIDE - 1).astype(int)
        radiance += outgoing.scale[row] * (outgoing.smooth if is_narrow else outgoing.table)[row, across * SIDE + along]
    return radiance


def shade_view(transfer, view: View, look):
    """Radiance of every view sample under a look, from the projector with no free curve. (n, 3)"""
    out = np.zeros((view.num_view_samples, 3))
    for index, name in enumerate(transfer.material_names):
        rows = view.rows(index)
        if rows.start == rows.stop:
            continue
        incident = gather_incident_light(transfer, view, index, look)
        for document, level_rows, lobe in split_by_roughness_level(view, index, look.materials[name].terms):
            lights, receivers = incident if lobe is None else trace_lobe_light(transfer, view, index, look, lobe)
            term = TERMS[document["model"]].normalized(document)
            bands = {curve.name: curve_bands(document, curve) for curve in term.curves}
            contraction = contract(term, bands, None)
            projector = Projector(term, contraction, lights, receivers)
            image = projector.project(level_rows.start, level_rows.stop)[:, 0]
            if lobe is not None:
                image = average_split_samples(transfer, view, index, look, lobe, level_rows, image, term, contraction)
            image = image.astype(float) * document["color"]
            texture = view.textures[index].get(document["texture"])
            if texture is not None:
                image *= texture[level_rows]
            for curve in term.curves:
                if curve.depends_on_view:
                    image *= curve_values(document, curve, np.arccos(view.cos_theta_o(index)[level_rows])).T
            out[rows][level_rows] += image
        out[rows] += evaluate_emission(transfer, view, index, look)
    if look.transport.paths.direct:
        background = transfer.background_in(look.environment.key, view)
        out[view.num_surface_samples :] = np.array(look.environment.gain) * background
    return out


def average_split_samples(transfer, view: View, index, look, lobe, level_rows, image, term, contraction):
    """The image of a level's samples, with the mean over the points of those that are split. (n, 3)

    The samples are chosen among those of the level alone, unless an image of all levels has chosen them before.
    """
    light = illumination_from_look(look, transfer.material_names, has_bounces=EditAxis.BOUNCES in transfer.axes)
    light = light._replace(environment_gain=look.environment.gain)
    radiance = np.zeros((view.rows(index).stop - view.rows(index).start, 3), np.float32)
    radiance[level_rows] = image
    split = transfer.split_light(view, index, light, lobe, lambda: radiance, lambda: False)
    if split is None:
        return image
    ends, image = np.append(split.first, split.points.points.num_points), image.copy()
    projector = Projector(term, contraction, split.lights, split.points)
    for k, row in enumerate(split.rows):
        if level_rows.start <= row < level_rows.stop:
            at_points = projector.project(ends[k], ends[k + 1])[:, 0].astype(float)
            image[row - level_rows.start] = at_points.mean(axis=0)
    return image


def split_by_roughness_level(view: View, index, terms):
    """Terms with their samples and lobes: one that follows a roughness map gives a term for every level."""
    pairs, level = view.roughness_levels(index)
    assert np.all(np.diff(level.astype(int)) >= 0)  # samples of a level are contiguous
    for term in terms:
        if not (pairs and term.get("roughness_map")):
            yield term, slice(0, len(level)), sample_lobe(term, view.roughness_levels(index))
            continue
        assert term["model"] == "ggx"
        for k, (ratio, variance) in enumerate(pairs):
            roughness = np.clip(np.array(term["params"]["roughness"]) * ratio, 0.01, 1).tolist()
            level_rows = slice(*np.searchsorted(level, [k, k + 1]))
            widened = {"slope_variance": variance} if variance > 0 else {}
            scaled = {**term, "params": {**term["params"], "roughness": roughness}, **widened}
            yield scaled, level_rows, sample_lobe(term, view.roughness_levels(index))


def evaluate_emission(transfer, view: View, index, look):
    """Emission of a material's samples. (n, 3)"""
    name, position = transfer.material_names[index], view.surface_points(index).position
    emitters = [light for light in look.lights.values() if light.geometry.material == name]
    if not emitters or not look.transport.paths.direct:
        return np.zeros((len(position), 3))
    camera_position = view.camera.to_world[:3, 3].astype(np.float32)
    emission = np.outer(
        transfer.local.is_emissive_at(index, camera_position, position), sum(np.array(light.gain) for light in emitters)
    )
    if transfer.store.attributes.get("has_emission_images"):
        emission = emission * view.store.read("views/0/emission", view.rows(index).start, view.rows(index).stop)
    return emission


def resolve(view: View, radiance):
    """Samples to pixels: the weighted sum of each pixel. radiance (n, 3) -> (height, width, 3) float64"""
    gains = np.empty((view.num_view_samples, view.throughput.shape[1]))
    gains[view.order] = view.throughput
    out = np.zeros((view.width * view.height, 3))
    np.add.at(out, view.pixel.astype(int), gains * radiance)
    return out.reshape(view.height, view.width, 3)


def full_evaluation(transfer, view_name, look):
    """The picture of a look without incremental updates, operators or caches. (height, width, 3) float64"""
    view = transfer.views[view_name]
    return resolve(view, shade_view(transfer, view, look))


def opacity_at(alpha, wrap, uv):
    """Bilinear opacity of an 8-bit image at UV coordinates (n, 2), v from the top. (n,)"""

    def wrapped(index, size, how):
        index = np.asarray(index, int)
        if how == "clamp":
            return np.clip(index, 0, size - 1)
        if how == "mirror":
            return np.minimum(index % (2 * size), 2 * size - 1 - index % (2 * size))
        return index % size

    height, width = alpha.shape
    x, y = np.asarray(uv, float).T * [[width], [height]] - 0.5
    (x0, fx), (y0, fy) = ((np.floor(v), v - np.floor(v)) for v in (x, y))
    total = np.zeros(len(x))
    for dy in (0, 1):
        for dx in (0, 1):
            texel = alpha[wrapped(y0 + dy, height, wrap[1]), wrapped(x0 + dx, width, wrap[0])]
            total += np.abs(1 - dx - fx) * np.abs(1 - dy - fy) * texel
    return total / 255
