"""Lobe rays: unbiased at any width, together with the triangles that they share light with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy_reference as ref
import pytest
from rgb9e5 import rgb9e5_pack

from relume.assets.environments.equirect import lookup, rotate_about_y
from relume.brdf.curves import curve_bands, curve_values
from relume.brdf.evaluate import angles_numpy
from relume.brdf.lobe_sampling import sample_lobe
from relume.brdf.registry import TERMS
from relume.brdf.roughness_levels import NO_LEVELS
from relume.brdf.term import Angle
from relume.brdf.term_validation import complete_term
from relume.lights.spherical_triangles import EnvironmentTexels, integrate_environment
from relume.lights.tile_subdivision import choose_tiles
from relume.live.opened.lobe_light import bright_triangles, lobe_environment, tile_of_texels
from relume.math.zernike import basis_functions
from relume.raytrace.lobe_directions import make_lobe_pattern
from relume.raytrace.tangents import any_tangent
from relume.transport.hit_textures import textured_light
from relume.transport.lobe_hits import NO_FOOTPRINT, LobeHits
from relume.transport.lobe_paths import END, NO_EMITTER, NO_SURFACES, LobePaths, no_paths
from relume.transport.lobe_rays import NO_EMISSION, NO_ENVIRONMENT, NO_PEAKS, LobeRays
from relume.transport.outgoing_patch_light import NUM_OUTGOING, isotropic, no_light, radiance_from_patch
from relume.transport.shading.shader import Shader
from relume.transport.shading_points import build_ray_lists
from relume.transport.term_contraction import contract

NUM_POINTS = 64
NO_HIT = 65_535
NO_SHARE = np.ones(65_536, np.float32)


def document(model, **params):
    return complete_term(("terms", 0), {"model": model, "params": params}, None)


def view(degrees):
    """Return the same point many times, from one direction; seeds differ. Normals and wo, (n, 3)"""
    angle = np.radians(degrees)
    normal = np.tile(np.float32([0.36, 0.48, 0.8]), (NUM_POINTS, 1))
    wo = np.cos(angle) * normal + np.sin(angle) * any_tangent(normal)
    return normal, wo.astype(np.float32)


def untextured(outgoing):
    """The light of patches without a texture."""
    shape = 2, len(outgoing.isotropic), 3
    return textured_light(outgoing.isotropic, np.zeros(shape), np.ones(shape), np.empty(0, np.int64))


def with_lobe_rays(term_document, normal, wo, radiance, *, num_lights=500, rotation=0.0, num_rays=144):
    """Points without occluders, with lobe rays and triangles of an environment."""
    tiles = choose_tiles(radiance, num_lights)
    lights = integrate_environment(tiles, EnvironmentTexels.from_radiance(radiance), rotation)
    pattern = make_lobe_pattern(sample_lobe(term_document, NO_LEVELS), num_rays, 3)
    hits = LobeHits(
        np.full((len(normal), num_rays), NO_HIT, np.uint16),
        np.full((len(normal), -(-num_rays // 8)), 255, np.uint8),
        np.empty((0, len(normal), num_rays), np.uint32),
        no_paths(len(normal)),
    )
    tile = tile_of_texels(tiles, radiance.shape[:2], rotation)
    shared = bright_triangles(lights)
    environment = lobe_environment(radiance, tile, rotation, lights, radiance, shared, is_direct=True)
    lights = lights.select(shared, lights.irradiance[shared])
    patches = no_light(), untextured(no_light())
    rays = LobeRays(hits, pattern, *patches, environment, NO_SHARE, NO_FOOTPRINT, NO_SURFACES, NO_PEAKS, NO_EMISSION)
    visible = np.full((len(normal), -(-lights.num_lights // 8)), 255, np.uint8)
    points = ref.make_receivers_at_origin(wo, normal, any_tangent(normal), visible)
    return lights, ref.only_above(replace(points, rays=(rays,)), lights)


def shade(term_document, lights, receivers):
    term = TERMS[term_document["model"]].normalized(term_document)
    bands = {c.name: curve_bands(term_document, c) for c in term.curves if not c.depends_on_view}
    shader = Shader(term, contract(term, bands, None), lights, receivers)
    return shader.project(0, len(receivers.normal))[:, 0].astype(float)


def brute_force(term_document, normal, wo, radiance_along):
    """∫ f L cos θi dω by half vectors on a fine grid about the lobe, exact curves; without curves of wo. (3,)"""
    term = TERMS[term_document["model"]]
    n, o = normal[0].astype(float), wo[0].astype(float)
    t = any_tangent(normal[:1])[0].astype(float)
    frame = np.stack([t, np.cross(n, t), n])
    local_o = frame @ o
    theta = np.sinh(np.linspace(0, np.arcsinh(np.pi / 2 / 1e-5), 2001)) * 1e-5
    middle, width = 0.5 * (theta[1:] + theta[:-1]), np.diff(theta)
    phi = (np.arange(360) + 0.5) * (2 * np.pi / 360)
    h = np.stack(np.broadcast_arrays(
        np.sin(middle)[:, None] * np.cos(phi), np.sin(middle)[:, None] * np.sin(phi), np.cos(middle)[:, None]
    ), -1)  # fmt: skip
    cos_d = h @ local_o
    i = 2 * cos_d[..., None] * h - local_o
    weight = (np.sin(middle) * width)[:, None] * (2 * np.pi / 360) * 4 * np.maximum(cos_d, 0) * np.maximum(i[..., 2], 0)
    value = term.quotients(*np.moveaxis(i, -1, 0), *local_o)[0] * weight
    for curve in term.curves:
        if not curve.depends_on_view:
            angle = middle[:, None] if curve.angle is Angle.THETA_H else angles_numpy(curve.angle, i, local_o)
            value = value * curve_values(term_document, curve, np.broadcast_to(angle, cos_d.shape))[0]
    keep = value > 0
    light = radiance_along((i[keep] @ frame).astype(np.float32))
    return (value[keep][:, None] * light).sum(axis=0)


@pytest.mark.parametrize("roughness", [0.01, 0.03, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("degrees", [0, 60])
def test_white_light_is_reflected_without_loss_or_noise(roughness, degrees):
    chrome, (normal, wo) = document("ggx", roughness=roughness, f0=1.0), view(degrees)
    white = np.ones((64, 128, 3), np.float32)
    radiance = shade(chrome, *with_lobe_rays(chrome, normal, wo, white))
    expected = brute_force(chrome, normal, wo, lambda directions: np.ones((len(directions), 3)))
    np.testing.assert_allclose(radiance.mean(axis=0), expected, rtol=0.01)
    assert radiance.std() < 0.02 * expected[0]


ANISOTROPIC = [
    document("ward_anisotropic", alpha_x=0.005, alpha_y=0.005),
    document("ward_anisotropic", alpha_x=0.01, alpha_y=0.2),
    document("ward_anisotropic", alpha_x=1.0, alpha_y=0.02),
    document("ashikhmin_shirley", nu=1e5, nv=1e5, f0=1.0),
    document("ashikhmin_shirley", nu=20.0, nv=2e4, f0=1.0),
]


@pytest.mark.parametrize("gloss", ANISOTROPIC)
@pytest.mark.parametrize("degrees", [0, 50])
def test_anisotropic_lobes_reflect_white_light_without_loss_or_noise(gloss, degrees):
    normal, wo = view(degrees)
    white = np.ones((64, 128, 3), np.float32)
    radiance = shade(gloss, *with_lobe_rays(gloss, normal, wo, white, num_rays=233))
    expected = brute_force(gloss, normal, wo, lambda directions: np.ones((len(directions), 3)))
    np.testing.assert_allclose(radiance.mean(axis=0), expected, rtol=0.015)
    assert radiance.std() < 0.04 * expected[0]


@pytest.mark.parametrize("gloss", ANISOTROPIC)
def test_rays_and_triangles_of_an_anisotropic_lobe_together_are_the_integral(gloss):
    radiance_map, (normal, wo) = gradient_with_sun(), view(20)
    lights, receivers = with_lobe_rays(gloss, normal, wo, radiance_map, num_lights=1500, num_rays=233)
    expected = brute_force(gloss, normal, wo, lambda directions: lookup(radiance_map, directions))
    np.testing.assert_allclose(shade(gloss, lights, receivers).mean(axis=0), expected, rtol=0.03)


@pytest.mark.parametrize(("mirror", "degrees"), [(-1.0, 40), (1.0, 40), (1.0, 0)])
def test_a_lafortune_lobe_is_about_the_mirror_direction_or_the_viewer(mirror, degrees):
    """(s + 2) / (s + 1) cos θ of white light."""
    gloss, (normal, wo) = document("lafortune", exponent=5e4, c_x=mirror, c_y=mirror), view(degrees)
    white = np.ones((64, 128, 3), np.float32)
    radiance = shade(gloss, *with_lobe_rays(gloss, normal, wo, white))
    np.testing.assert_allclose(radiance.mean(axis=0), np.cos(np.radians(degrees)), rtol=2e-3)
    assert radiance.std() < 0.01


def gradient_with_sun():
    """A gradient, and a sun of some texels that brings half of the light."""
    rng = np.random.default_rng(5)
    radiance = np.linspace(0.2, 1, 128 * 3).reshape(128, 1, 3) * rng.uniform(0.8, 1.2, (128, 256, 1))
    radiance[30:32, 70:72] = 3000
    return radiance.astype(np.float32)


@pytest.mark.parametrize("roughness", [0.03, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("rotation", [0.0, 50.0])
def test_rays_and_triangles_together_are_the_integral(roughness, rotation):
    """Also where the sun is in the lobe, by whichever estimator."""
    gloss, radiance_map = document("ggx", roughness=roughness, f0=0.5), gradient_with_sun()
    normal, wo = view(20)

    def along(directions):
        return lookup(radiance_map, rotate_about_y(directions.astype(np.float64), -rotation).astype(np.float32))

    lights, receivers = with_lobe_rays(gloss, normal, wo, radiance_map, rotation=rotation, num_lights=1500)
    radiance, expected = shade(gloss, lights, receivers).mean(axis=0), brute_force(gloss, normal, wo, along)
    np.testing.assert_allclose(radiance, expected, rtol=0.03)


@pytest.mark.parametrize("num_rays", [34, 1597])
@pytest.mark.parametrize("roughness", [0.05, 0.15, 0.22])
def test_clusters_of_triangles_shine_as_their_triangles(roughness, num_rays):
    """In clusters that share their light with many rays, and in those that do not."""
    gloss, radiance_map = document("ggx", roughness=roughness, f0=0.5), np.full((128, 256, 3), 0.1, np.float32)
    radiance_map[20:40, 60:80] = 50
    toward = lookup_direction(30, 70)
    for degrees in (0, 2, 5, 10):
        half = np.radians(degrees)
        axis = np.cos(half) * toward + np.sin(half) * any_tangent(toward[None].astype(np.float32))[0]
        normal = np.tile(axis, (NUM_POINTS, 1)).astype(np.float32)
        args = gloss, normal, normal, radiance_map
        lights, receivers = with_lobe_rays(*args, num_lights=1500, num_rays=num_rays)
        assert lights.clusters is not None
        alone = shade(gloss, replace(lights, codes=None), receivers)
        np.testing.assert_allclose(shade(gloss, lights, receivers), alone, rtol=4e-3)


@pytest.mark.parametrize("roughness", [0.1, 0.15, 0.2])
def test_a_wide_light_at_the_foot_of_a_lobe_is_no_dots(roughness):
    """Hundreds of triangles, each met by a ray of few points; the mirror direction is 14° beside them."""
    gloss, radiance_map = document("ggx", roughness=roughness, f0=0.9), np.full((128, 256, 3), 0.1, np.float32)
    radiance_map[20:40, 60:80] = 50
    aside = lookup_direction(30, 90)
    normal = np.tile(aside, (NUM_POINTS, 1)).astype(np.float32)
    lights, receivers = with_lobe_rays(gloss, normal, normal, radiance_map, num_lights=1500)
    radiance = shade(gloss, lights, receivers)[:, 0]
    assert radiance.max() < 1.02 * radiance.mean()


def lookup_direction(row, column):
    """Direction of a texel's corner in a map of 128 × 256 texels. (3,)"""
    azimuth, elevation = 2 * np.pi * (column / 256 - 0.5), np.pi * (0.5 - row / 128)
    return np.array([np.cos(elevation) * np.cos(azimuth), np.sin(elevation), np.cos(elevation) * np.sin(azimuth)])


def test_a_sun_in_the_lobe_is_no_noise():
    gloss, radiance_map = document("ggx", roughness=0.22, f0=0.5), gradient_with_sun()
    row, column = divmod(int(np.argmax(radiance_map[..., 0])), 256)
    toward = lookup_direction(row + 0.5, column + 0.5)
    normal = np.tile(toward, (NUM_POINTS, 1)).astype(np.float32)
    radiance = shade(gloss, *with_lobe_rays(gloss, normal, normal, radiance_map, num_lights=1500))
    assert radiance.std(axis=0)[0] < 0.05 * radiance.mean(axis=0)[0]


def test_rays_that_hit_a_patch_bring_its_light():
    chrome, (normal, wo) = document("ggx", roughness=0.1, f0=1.0), view(40)
    pattern = make_lobe_pattern(sample_lobe(chrome, NO_LEVELS), 55, 3)
    patch = np.full((NUM_POINTS, 55), 7, np.uint16)
    patch[:, ::2] = NO_HIT  # a surface without a patch is black
    light = np.zeros((65_536, 3), np.float32)
    light[7] = 1, 2, 3
    no_texture = np.empty((0, NUM_POINTS, 55), np.uint32)
    hits = LobeHits(patch, np.zeros((NUM_POINTS, 7), np.uint8), no_texture, no_paths(NUM_POINTS))
    points = ref.make_receivers_at_origin(wo, normal, any_tangent(normal), np.zeros((NUM_POINTS, 1), np.uint8))
    patches = isotropic(light), untextured(isotropic(light))
    rays = LobeRays(hits, pattern, *patches, NO_ENVIRONMENT, NO_SHARE, NO_FOOTPRINT, NO_SURFACES, NO_PEAKS, NO_EMISSION)
    listed = build_ray_lists(rays, points, 0, NUM_POINTS)
    num = int(listed.first[-1])
    assert 0.99 * 27 * NUM_POINTS < num <= 27 * NUM_POINTS  # few leave below the horizon
    np.testing.assert_allclose(listed.irradiance[1, :num], 2 * listed.irradiance[0, :num], rtol=1e-5)
    half = listed.wi[:, :num] + listed.wo[:, :num]
    cos_theta_h = half[2] / np.linalg.norm(half, axis=0)
    assert np.degrees(np.arccos(np.clip(np.median(cos_theta_h), 0, 1))) < 1


def test_rays_bring_the_light_of_a_patch_times_the_texture_by_its_mean():
    """Each term with its own texture: the rest of the patch's light has none."""
    chrome, (normal, wo) = document("ggx", roughness=0.1, f0=1.0), view(40)
    pattern = make_lobe_pattern(sample_lobe(chrome, NO_LEVELS), 55, 3)
    patch = np.full((NUM_POINTS, 55), 7, np.uint16)
    light = np.zeros((65_536, 3), np.float32)
    light[7] = 1, 2, 4
    mean, unit_share = np.ones((2, 65_536, 3), np.float32), np.zeros((2, 65_536, 3), np.float32)
    mean[0, 7], mean[1, 7] = 0.5, 0.25
    unit_share[0, 7], unit_share[1, 7] = 0.5 / 0.5, 0.3 / 0.25  # half of the light is diffuse, a fifth has no texture
    texture = np.empty((2, NUM_POINTS, 55), np.uint32)
    texture[0], texture[1] = rgb9e5_pack(np.float32([1.0, 0.5, 0.0])), rgb9e5_pack(np.float32([0.25, 0.5, 0.0]))
    hits = LobeHits(patch, np.zeros((NUM_POINTS, 7), np.uint8), texture, no_paths(NUM_POINTS, 2))
    points = ref.make_receivers_at_origin(wo, normal, any_tangent(normal), np.zeros((NUM_POINTS, 1), np.uint8))
    factor = np.array([2 * 0.5 + 0.3 + 0.2, 0.5 + 2 * 0.3 + 0.2, 0.2])

    def listed(textured):
        patches = isotropic(light), textured
        rays = LobeRays(
            hits, pattern, *patches, NO_ENVIRONMENT, NO_SHARE, NO_FOOTPRINT, NO_SURFACES, NO_PEAKS, NO_EMISSION
        )
        lists = build_ray_lists(rays, points, 0, NUM_POINTS)
        return lists.irradiance[:, : int(lists.first[-1])].copy()

    plain = listed(untextured(isotropic(light)))
    textured = listed(textured_light(light, unit_share, mean, np.array([0, 1])))
    np.testing.assert_allclose(textured, plain * factor[:, None], rtol=0.01)


@pytest.mark.parametrize("specular_share", [0.0, 0.4])
def test_rings_are_no_darker_than_the_light_they_belong_to(specular_share):
    """A gold rim on porcelain: the texture is twelve times the patch's mean, and directional light rings."""
    chrome, (normal, wo) = document("ggx", roughness=0.1, f0=1.0), view(40)
    pattern = make_lobe_pattern(sample_lobe(chrome, NO_LEVELS), 55, 3)
    light = np.zeros((65_536, 3), np.float32)
    light[7:9] = 1
    bright = 5 * basis_functions(np.array([[0.0, 0, 1]]))[:, None, :NUM_OUTGOING]
    ringing = np.repeat(np.concatenate([bright, -bright]), 3, axis=1).astype(np.float32)
    # rays leave along the mirror direction, which the patches see along their normals
    along = wo[:1] - 2 * (wo[:1] * normal[:1]).sum() * normal[:1]
    across = any_tangent(along)
    frame = np.repeat(np.stack([across, np.cross(along, across)], axis=1), 2, axis=0).astype(np.float32)
    outgoing = radiance_from_patch(light, np.array([7, 8]), frame, ringing)
    mean, unit_share = np.ones((2, 65_536, 3), np.float32), np.zeros((2, 65_536, 3), np.float32)
    mean[1, 7:9], unit_share[1, 7:9] = 0.25, specular_share / 0.25
    hits = LobeHits(
        np.ascontiguousarray(np.tile(np.uint16([7, 8]), (NUM_POINTS, 28))[:, :55]), np.zeros((NUM_POINTS, 7), np.uint8),
        np.full((1, NUM_POINTS, 55), rgb9e5_pack(np.float32([3, 3, 3])), np.uint32), no_paths(NUM_POINTS, 1),
    )  # fmt: skip
    points = ref.make_receivers_at_origin(wo, normal, any_tangent(normal), np.zeros((NUM_POINTS, 1), np.uint8))

    def listed(outgoing, unit_share):
        textured = textured_light(light, unit_share, mean, np.array([1]))
        rays = LobeRays(
            hits, pattern, outgoing, textured, NO_ENVIRONMENT, NO_SHARE, NO_FOOTPRINT, NO_SURFACES, NO_PEAKS,
            NO_EMISSION,
        )  # fmt: skip
        lists = build_ray_lists(rays, points, 0, NUM_POINTS)
        return lists.irradiance[:, : int(lists.first[-1])].copy()

    weight = listed(isotropic(light), 0 * unit_share)
    radiance = listed(outgoing, unit_share) / weight
    even = 1 - specular_share  # light without the texture
    least = even if specular_share else 0
    bright, dark = radiance.max(axis=1), radiance.min(axis=1)
    np.testing.assert_allclose(dark, least, atol=1e-4)
    assert np.all(bright > 10)


def test_polished_surfaces_reflect_lights_with_their_images():
    """Every other path of a ray ends on a light."""
    chrome, (normal, wo) = document("ggx", roughness=0.1, f0=1.0), view(40)
    pattern = make_lobe_pattern(sample_lobe(chrome, NO_LEVELS), 55, 3)
    points = ref.make_receivers_at_origin(wo, normal, any_tangent(normal), np.zeros((NUM_POINTS, 1), np.uint8))
    paths = LobePaths.allocate(NUM_POINTS, NUM_POINTS * 55, 0)
    paths.first[:] = 55 * np.arange(NUM_POINTS + 1)
    paths.ray[:] = np.tile(np.arange(55), NUM_POINTS)
    paths.kind[:], paths.patch[:], paths.lobe[:] = END, NO_HIT, 0
    paths.emitter[:] = np.where(paths.ray % 2, NO_EMITTER, 1)
    paths.emission[:] = rgb9e5_pack(np.float32([0.5, 1, 2]))
    paths.throughput[:] = 0.5
    light = np.zeros((65_536, 3), np.float32)
    light[7] = 1

    def listed(patch_light, paths, emission):
        hits = LobeHits(
            np.full((NUM_POINTS, 55), 7, np.uint16), np.zeros((NUM_POINTS, 7), np.uint8),
            np.empty((0, NUM_POINTS, 55), np.uint32), paths,
        )  # fmt: skip
        patches = isotropic(patch_light), untextured(isotropic(patch_light))
        rays = LobeRays(
            hits, pattern, *patches, NO_ENVIRONMENT, NO_SHARE, NO_FOOTPRINT, NO_SURFACES, NO_PEAKS, emission
        )
        lists = build_ray_lists(rays, points, 0, NUM_POINTS)
        return lists.irradiance[:, : int(lists.first[-1])].copy()

    weight = listed(light, no_paths(NUM_POINTS), NO_EMISSION)[0]
    reflected = listed(np.zeros_like(light), paths, np.float32([[9, 9, 9], [10, 20, 40]]))
    is_lit = reflected[0] > 0
    assert 0.49 < is_lit.mean() < 0.52
    np.testing.assert_allclose(reflected[:, is_lit], np.outer([2.5, 10, 40], weight[is_lit]), rtol=1e-5)
    assert not reflected[:, ~is_lit].any()


def test_rows_keep_their_rays():
    chrome, (normal, wo) = document("ggx", roughness=0.2, f0=1.0), view(30)
    lights, receivers = with_lobe_rays(chrome, normal, wo, gradient_with_sun())
    whole = shade(chrome, lights, receivers)
    rows = np.array([3, 9, 40])
    np.testing.assert_allclose(shade(chrome, lights, receivers.subset(rows)), whole[rows], rtol=1e-4)
