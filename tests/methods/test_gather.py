"""Indirect light in pictures: the kernel against plain NumPy, pictures against path tracing and against bakes."""

from __future__ import annotations

import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy_reference as ref
import pytest
from analytic_terms import ANALYTIC
from exact_pictures import render_uncached
from session_edits import BUDGET, bake_corner_scene, kind_of, make_look, relative_rmse, run_until_exact
from tiny_scenes import make_camera, make_tiny_scene, quad

from relume.assets.environments.equirect import texel_directions
from relume.brdf.albedo import material_reflectance, reflectance
from relume.brdf.curves import curve_bands
from relume.brdf.evaluate import eval_brdf
from relume.brdf.registry import TERMS
from relume.core.cache import Cache
from relume.lights.spherical_triangles import tessellate_environment
from relume.live.fixed_camera.illumination import illumination_from_look
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_transfer
from relume.look import LightPaths, validate
from relume.math.direction_grid import bin_solid_angles
from relume.math.zernike import OUTGOING_DEGREE
from relume.output.render_image import render_image
from relume.patches.patch_kdtree import NO_PATCH
from relume.patches.patches import patch_sample_points
from relume.radiosity.patch_irradiance import PatchLight
from relume.radiosity.reflectance_operator import IncidentLight
from relume.radiosity.solve_bounces import solve_bounces
from relume.raytrace.gather_rays import lattice_offsets, local_ray, make_pattern, ray_weight
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.reference import ReferencePoints, environment_texels
from relume.reference.path_tracing import reference_indirect
from relume.reference.radiance import material_lobes
from relume.scene.model import Material
from relume.transport.outgoing_patch_light import SIDE
from relume.transport.projector import Projector
from relume.transport.shading_points import GatherRays, ShadingPoints
from relume.transport.term_contraction import contract

NUM_PATCHES = 90
CURVES = [(model, c.name) for model, term in ANALYTIC.items() for c in term.curves if not c.depends_on_view]
PLAIN = {"texture": None, "params": {}, "curves": {}}
REFLECTANCES = (
    material_reflectance([{**PLAIN, "model": "lambert", "color": [0.5, 0.4, 0.3]}]),
    material_reflectance(
        [
            {**PLAIN, "model": "lambert", "color": [0.6, 0.2, 0.4], "texture": "diffuse"},
            {**PLAIN, "model": "blinn_phong", "color": [0.1, 0.1, 0.2], "params": {"exponent": 30.0}},
        ]
    ),
)
BLACK = material_reflectance([])


@pytest.fixture(scope="module")
def lights():
    return tessellate_environment(np.random.default_rng(3).random((16, 32, 3), np.float32), 40)


@pytest.fixture(scope="module")
def patches(lights):
    rng = np.random.default_rng(4)
    normal = ref.unit(rng.normal(size=(NUM_PATCHES, 4, 3))).astype(np.float32)
    visible = rng.integers(0, 256, (NUM_PATCHES, 4, (lights.num_lights + 7) // 8)).astype(np.uint8)
    hits = rng.integers(0, NUM_PATCHES, (NUM_PATCHES, 16)).astype(np.uint16)
    material = rng.integers(0, 2, NUM_PATCHES).astype(np.uint16)
    points = patch_sample_points(normal, normal)
    return PatchLight(
        points, visible, hits, make_pattern(4, 0, 9), material, rng.random((2, NUM_PATCHES, 3), np.float32)
    )


def outgoing_from_patches(patches, lights, first=1, last=24, reflectances=REFLECTANCES):
    reflecting = patches.reflectance_operator(reflectances)
    vectors = patches.incident_coefficients(reflecting.rows, lights, OUTGOING_DEGREE)
    return solve_bounces(
        patches, reflecting, IncidentLight(patches.irradiance(lights), vectors), first, last
    ).outgoing_light(patches)


def radiance_by_bin(outgoing):
    """All outgoing radiance in every direction bin. (patches, bins, 3)"""
    radiance = np.repeat(outgoing.isotropic[:NUM_PATCHES, None].astype(float), SIDE * SIDE, axis=1)
    has = outgoing.lobe[:NUM_PATCHES] >= 0
    radiance[has] += (outgoing.scale[:, None] * outgoing.table)[outgoing.lobe[:NUM_PATCHES][has]]
    return radiance


@pytest.fixture(scope="module")
def receivers(patches, lights):
    """Points with indirect light only; a tenth of the rays hits nothing."""
    rng = np.random.default_rng(5)
    dark = ref.make_random_receivers(30, lights.num_lights, seed=6)
    pattern = make_pattern(20, 13, 7)
    hits = rng.integers(0, NUM_PATCHES, (30, 33)).astype(np.uint16)
    for p in range(30):
        wo = ref.frames(dark)[p] @ dark.wo[p]
        for ray in range(33):
            below = local_ray(pattern, ray, lattice_offsets(pattern, 50 + p), *wo.astype(np.float32))[2] <= 0
            if below or rng.random() < 0.1:
                hits[p, ray] = NO_PATCH
    rays = GatherRays(hits, pattern, outgoing_from_patches(patches, lights))
    points = dark.points._replace(seed=np.arange(50, 80, dtype=np.uint32))
    return ShadingPoints(points, dark.wo, np.zeros_like(dark.visible), (rays,))


def bands_of(model):
    rng = np.random.default_rng(1)
    bands = {}
    for curve in TERMS[model].curves:
        x = np.linspace(0, 1, curve.num_bands)
        bands[curve.name] = rng.uniform(0.2, 1, (3, 1)) + 0.15 * np.sin(rng.uniform(3, 12, (3, 1)) * x)
    return bands


def image(model, bands, active, lights, receivers):
    term = TERMS[model]
    pixels = Projector(term, contract(term, bands, active), lights, receivers).project(0, len(receivers.normal))
    return pixels[:, 0] if active is None else np.einsum("njc,cj->nc", pixels.astype(float), bands[active])


def image_numpy(model, bands, receivers):
    """Ray by ray, float64."""
    term, (rays,) = TERMS[model], receivers.rays
    out = np.zeros((len(receivers.normal), 3))
    for p, frame in enumerate(ref.frames(receivers)):
        wo = frame @ receivers.wo[p].astype(float)
        shift = lattice_offsets(rays.pattern, receivers.points.seed[p])
        for ray, patch in enumerate(rays.gather_hits[p]):
            if patch == NO_PATCH:
                continue
            wi = np.array(local_ray(rays.pattern, ray, shift, *wo.astype(np.float32)))
            weight = ray_weight(rays.pattern, *wi.astype(np.float32), *wo.astype(np.float32))
            is_narrow = 2 * rays.pattern.num_cosine * weight < np.pi
            value = weight * ref.evaluate_outgoing(rays.outgoing, patch, -(wi @ frame), is_narrow=is_narrow)
            value = value * term.quotients(*wi.astype(float), *wo)
            for curve in term.curves:
                if not curve.depends_on_view:
                    value = value * bands[curve.name][:, ref.find_bands(curve, wi.astype(float)[None], wo)[0]]
            out[p] += value
    return out


def test_rays_of_view_independent_terms_are_summed(lights, receivers):
    """Cosine rays alone, and nothing is listed; back faces reflect nothing."""
    bands = {"theta_i": np.full((3, 64), [[0.5], [1.0], [0.25]])}
    behind = replace(receivers, wo=np.where(np.arange(30)[:, None] < 3, -receivers.wo, receivers.wo))
    (rays,) = receivers.rays
    cosine_rays = replace(rays, gather_hits=rays.gather_hits[:, :20], pattern=make_pattern(20, 0, 7))
    expected = image_numpy("lambert", bands, replace(behind, rays=(cosine_rays,)))
    actual = image("lambert", bands, None, lights, behind)
    np.testing.assert_allclose(actual, expected, rtol=2e-5, atol=1e-6 * expected.max())
    assert expected[3:].min() > 0
    assert not expected[:3].any()


@pytest.mark.parametrize("model", list(ANALYTIC))
def test_gathered_radiance_equals_plain_numpy(model, lights, receivers):
    bands = bands_of(model)
    expected = image_numpy(model, bands, receivers)
    actual = image(model, bands, None, lights, receivers)
    # an angle within rounding of a band's edge may fall to either side
    np.testing.assert_allclose(actual, expected, rtol=5e-3, atol=5e-3 * np.abs(expected).max())
    assert np.median(np.abs(actual - expected)) < 1e-4 * np.abs(expected).max()


@pytest.mark.parametrize(("model", "curve"), CURVES)
def test_any_curve_of_gathered_light_can_be_free(model, curve, lights, receivers):
    bands = bands_of(model)
    none = image(model, bands, None, lights, receivers)
    np.testing.assert_allclose(image(model, bands, curve, lights, receivers), none, rtol=1e-4, atol=2e-6 * none.max())


def test_several_settings_equal_single_ones(lights, receivers):
    bands = bands_of("cook_torrance")
    name = TERMS["cook_torrance"].curves[0].name
    several = np.stack([bands[name] * k for k in (1.0, 2.0, 0.5)], axis=1)
    term = TERMS["cook_torrance"]
    together = Projector(term, contract(term, {**bands, name: several}, None), lights, receivers).project(0, 30)
    for k in range(3):
        alone = image("cook_torrance", {**bands, name: several[:, k]}, None, lights, receivers)
        np.testing.assert_allclose(together[:, k], alone, rtol=1e-4, atol=1e-6 * alone.max())


def test_indirect_light_adds_to_direct_light(lights, receivers):
    lit = ref.only_above(ref.make_random_receivers(30, lights.num_lights, seed=6), lights)
    direct_and_indirect = replace(receivers, visible=lit.visible)
    bands = bands_of("blinn_phong")
    parts = [image("blinn_phong", bands, None, lights, r) for r in (lit, receivers)]
    np.testing.assert_allclose(image("blinn_phong", bands, None, lights, direct_and_indirect), sum(parts), rtol=1e-5)


def test_black_surfaces_reflect_nothing_and_bounces_are_counted(patches, lights):
    black = outgoing_from_patches(patches, lights, 1, 5, (BLACK, BLACK))
    assert not radiance_by_bin(black).any()
    by_bounces = [radiance_by_bin(outgoing_from_patches(patches, lights, 1, n)).sum() for n in (1, 2, 3, 25, 26)]
    assert by_bounces[0] < by_bounces[1] < by_bounces[2] < by_bounces[3]
    assert by_bounces[4] == pytest.approx(by_bounces[3], rel=1e-4)


def test_first_and_further_bounces_sum_to_all(patches, lights):
    """Their flux does: rings are clipped in each, so that single bins may differ."""
    for split in (1, 2, 3):  # some of them have direction bins
        parts = [
            np.tensordot(bin_solid_angles(), radiance_by_bin(outgoing_from_patches(patches, lights, *which)), (0, 1))
            for which in ((1, split), (split + 1, 6), (1, 6))
        ]
        np.testing.assert_allclose(parts[0] + parts[1], parts[2], rtol=1e-3, atol=1e-4 * parts[2].max())
        assert np.all(parts[1].sum(axis=0) > 0)


def test_reflectance_uses_the_texture_of_each_term(patches):
    reflectance_map = patches.reflectance_operator(REFLECTANCES)
    unpacked = [of_material.matrix[..., 0] for of_material in REFLECTANCES]
    expected = np.where(
        patches.material[:, None] == 0, unpacked[0][0], unpacked[1][0] + unpacked[1][1] * patches.textures[0]
    )
    np.testing.assert_allclose(reflectance_map.reflectance, np.minimum(expected, 1), rtol=1e-5)
    np.testing.assert_array_equal(reflectance_map.rows, np.flatnonzero(patches.material == 1))


def test_reflectance_of_diffuse_terms():
    lambert = {"model": "lambert", "color": [0.2, 0.5, 0.9], "texture": None, "params": {}, "curves": {}}
    np.testing.assert_allclose(reflectance(lambert), [0.2, 0.5, 0.9], rtol=1e-6)
    rough = {**lambert, "model": "oren_nayar", "params": {"sigma": 0.5}}
    assert 0.5 < reflectance(rough)[1] / 0.5 < 1.0


def test_reflectance_of_highlights():
    """Known for a cosine lobe cos^s in θh; a mirror of any width reflects its Fresnel curve."""
    plain = {"color": [1.0, 0.5, 0.0], "texture": None, "curves": {}}
    for exponent in (5.0, 400.0, 20_000.0):
        blinn = {**plain, "model": "blinn_phong", "params": {"exponent": exponent}}
        np.testing.assert_allclose(reflectance(blinn), _by_sampling(blinn), rtol=0.02)
    lambert = {**plain, "model": "lambert", "params": {}}
    combined = material_reflectance([lambert, {**blinn, "texture": "specular"}]).matrix[..., 0]
    np.testing.assert_allclose(combined[0], [1.0, 0.5, 0.0], rtol=1e-6)
    np.testing.assert_allclose(combined[2], reflectance(blinn), atol=0.5 / 128)


def _by_sampling(document):
    """Reflectance by Monte Carlo: ωi sampled from the term's own lobe."""
    rng = np.random.default_rng(3)
    r, phi = np.sqrt(rng.random(4000)), 2 * np.pi * rng.random(4000)
    wo = np.stack([r * np.cos(phi), r * np.sin(phi), np.sqrt(1 - r * r)], axis=-1)
    lobe = material_lobes([document])[1]
    wi = lobe.draw(wo, 64, rng)
    weight = np.where(wi[..., 2] > 0, wi[..., 2] / np.maximum(lobe.pdf(wi, wo), 1e-12), 0.0)
    wi[wi[..., 2] <= 0] = [0.0, 0.0, 1.0]
    return (eval_brdf(document, wi, wo[:, None]) * weight[..., None]).mean(axis=(0, 1))


def default_look(transfer):
    return validate(transfer.default_look, transfer.default_look)


def against_paths(scene, transfer, index, every, spp):
    """Indirect light at samples of a material, and by path tracing with its variance. (n, 3)"""
    view, look, name = transfer.views["front"], default_look(transfer), transfer.material_names[index]
    reflected = transfer.indirect.outgoing_light(
        illumination_from_look(look, transfer.material_names, has_bounces=True)
    )
    rows = view.rows(index)
    lit = replace(view.receivers(index), rays=(replace(view.gather_rays(index), outgoing=reflected),))
    rows_compared, dark = np.arange(0, rows.stop - rows.start, every), replace(lit, visible=0 * lit.visible)
    radiance = np.zeros((len(lit.normal), 3))
    for document in look.materials[name].terms:
        bands = {c.name: curve_bands(document, c) for c in TERMS[document["model"]].curves}
        radiance += image(document["model"], bands, None, transfer.lights, dark) * document["color"]
    position = view.store.read("views/0/position", rows.start, rows.stop)
    ones = np.ones_like(position)
    points = ReferencePoints(position, lit.normal, lit.tangent, lit.wo, {"diffuse": ones, "specular": ones}, ones[:, 0])
    points = points.samples_of(rows_compared)
    traced = (
        build_scene_buffers(scene),
        environment_texels(scene.environment),
        look,
        points,
        np.full(len(rows_compared), index),
    )
    reference = reference_indirect(scene, *traced, [LightPaths(False, 1, 4)], 48, spp, seed=index)
    return radiance[rows_compared], reference.mean[0], reference.variance[0], position[rows_compared]


def test_gathered_light_equals_path_tracing(corner, gathered):
    """A few hundred points: their mean within 1 %, each within the noise of paths and rays."""
    parts = [against_paths(corner, gathered, index, 12, 24)[:3] for index in range(len(gathered.material_names))]
    reference, gathered_light, variance = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    deviation = np.sqrt(variance.sum(axis=0)) / len(reference)  # of the mean
    assert np.all(
        np.abs(reference.mean(axis=0) - gathered_light.mean(axis=0))
        < 4 * deviation + 0.01 * gathered_light.mean(axis=0)
    )
    square, noise = ((reference - gathered_light) ** 2).mean(), variance.mean()
    assert np.sqrt(max(0.0, square - noise) / (gathered_light**2).mean()) < 0.12


def test_a_metal_floor_reflects_light_in_the_right_direction(tmp_path):
    """A low western sun over rough metal: the eastern wall gets almost twice the light of the northern one."""
    radiance = np.full((32, 64, 3), 0.02, np.float32)
    sun = ref.unit(np.array([-0.75, 0.66, 0.0]))
    radiance[texel_directions(32, 64) @ sun > 0.95] = 20.0
    white = Material("White", [{"model": "lambert", "color": [0.7, 0.7, 0.7], "texture": None}])
    rough = {"model": "ggx", "color": [1, 1, 1], "texture": None, "params": {"roughness": 0.55, "f0": 0.9}}
    floor = quad("floor", [(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)], 1)
    east = quad("east", [(1, 0, -1), (1, 0, 1), (1, 1.2, 1), (1, 1.2, -1)], 0, (0, 0, 1))
    north = quad("north", [(-1, 0, -1), (1, 0, -1), (1, 1.2, -1), (-1, 1.2, -1)], 0)
    camera = make_camera("front", (-0.9, 0.9, 2.2), (0.2, 0.5, -0.3), 0.9)
    scene = make_tiny_scene(
        floor, east, north, camera=camera, environment=radiance, materials=[white, Material("Metal", [rough])]
    )
    transfer = bake_corner_scene(scene, "gather", tmp_path)
    reference, expected, variance, position = against_paths(scene, transfer, 0, 1, 64)  # with the noise of 48 paths
    means = []
    for wall in (position[:, 0] > 0.99, position[:, 2] < -0.99):
        mean, expected_mean = reference[wall].mean(), expected[wall].mean()
        deviation = np.sqrt(variance[wall].sum(axis=0)).mean() / wall.sum()  # channels share paths
        assert abs(mean - expected_mean) < 0.04 * expected_mean + 3 * deviation
        assert deviation < 0.03 * expected_mean
        means.append(expected_mean)
    assert means[0] > 1.5 * means[1]


def test_colors_of_a_look_equal_a_bake_with_these_colors(corner, gathered, tmp_path):
    """The wall made green in the look: its light on the floor equals that of a bake with a green wall."""

    def green(document):
        document["materials"]["Red"]["terms"][0]["color"] = [0.1, 0.7, 0.2]

    edited = render_image(gathered, "front", make_look(gathered, green))
    terms = copy.deepcopy(corner.materials[1].terms)
    terms[0]["color"] = [0.1, 0.7, 0.2]
    materials = [corner.materials[0], Material("Red", terms), corner.materials[2]]
    other = make_tiny_scene(
        *corner.meshes, camera=corner.cameras[0], environment=corner.environment.radiance, materials=materials
    )
    green_bake = bake_corner_scene(other, "gather", tmp_path)
    expected = render_image(green_bake, "front", default_look(green_bake))
    before = render_image(gathered, "front", default_look(gathered))
    assert np.abs(edited - before).mean() > 0.05 * before.mean()
    # other seeds and patches: the light is compared, not its noise
    assert np.abs(edited - expected).mean() < 0.02 * expected.mean()


@pytest.fixture(scope="module")
def direct(corner, tmp_path_factory):
    return bake_corner_scene(corner, "direct", tmp_path_factory.mktemp("direct"))


def test_without_reflectance_the_picture_has_direct_light_only(gathered, direct):
    """With all diffuse terms black."""

    def black(document):
        for material in document["materials"].values():
            material["terms"][0]["color"] = [0.0, 0.0, 0.0]

    expected = render_image(direct, "front", make_look(direct, black))
    np.testing.assert_allclose(render_image(gathered, "front", make_look(gathered, black)), expected, rtol=1e-5)
    brighter = render_image(gathered, "front", default_look(gathered)) - render_image(
        direct, "front", default_look(direct)
    )
    assert brighter.min() > -1e-5
    assert brighter.mean() > 0.02


def showing(transfer, show, bounces=24):
    """A picture of some light paths only."""

    def change(document):
        document["transport"] = {"show": show, "bounces": bounces}

    return render_uncached(transfer, make_look(transfer, change))


def test_pictures_of_light_paths_sum_to_the_whole(gathered):
    whole = render_image(gathered, "front", default_look(gathered))
    parts = [showing(gathered, show) for show in ("direct", "first_bounce", "further_bounces")]
    np.testing.assert_allclose(sum(parts), whole, rtol=1e-4, atol=1e-6)
    assert all(path_image.mean() > 0.005 * whole.mean() for path_image in parts)


def test_bounces_are_counted_from_direct_light(gathered, direct):
    unreflected = showing(gathered, "direct")
    np.testing.assert_array_equal(showing(gathered, "all", 0), unreflected)
    np.testing.assert_array_equal(unreflected, render_image(direct, "front", default_look(direct)))
    first_bounce = showing(gathered, "all", 1)
    np.testing.assert_allclose(first_bounce - unreflected, showing(gathered, "first_bounce"), atol=2e-5)
    assert not showing(gathered, "further_bounces", 1).any()
    assert not showing(gathered, "first_bounce", 0).any()
    for show in ("first_bounce", "further_bounces"):
        assert not showing(direct, show).any()
    np.testing.assert_array_equal(showing(direct, "all", 3), unreflected)


def test_the_displayed_paths_can_change_in_a_session(gathered, monkeypatch):
    """From indirect light alone, previewed before other light is ready, to all light."""
    monkeypatch.setattr("relume.live.fixed_camera.strategies.sparse_preview._NUM_SHADED", 300)
    picture = Picture(gathered, "front", Cache(BUDGET))
    for show in ("first_bounce", "all", "direct"):

        def change(document, show=show):
            document["transport"]["show"] = show

        picture.set_look(make_look(gathered, change))
        if show == "all":
            picture.advance(None)
            need = picture.next_job()
            assert kind_of(need) == "preview"
            need.apply(need.run(lambda fraction: None, lambda: False))
            picture.advance(None)
            preview = picture.image()
            exact = run_until_exact(picture).image()
            assert relative_rmse(preview, exact) < 0.5 * relative_rmse(showing(gathered, "first_bounce"), exact)
        np.testing.assert_array_equal(run_until_exact(picture).image(), showing(gathered, show))


def test_a_downsampled_bake_has_the_same_light(gathered, monkeypatch):
    """Its samples keep their traced rays; neighbors differ."""
    monkeypatch.setattr("relume.views.view.NeighborFilter.of_samples", lambda *of_samples: None)
    transfer, step = open_transfer(Path(gathered.key), Cache(1 << 30)), 3
    whole = Picture(transfer, "front", Cache(BUDGET))
    few = Picture(transfer.downsampled("front", step), "front", Cache(BUDGET))
    for picture in (whole, few):  # no look with stored images
        picture.set_look(make_look(transfer, lambda document: document["transport"].update(bounces=5)))
    remaining = run_until_exact(whole).image()[step // 2 :: step, step // 2 :: step]
    np.testing.assert_allclose(run_until_exact(few).image(), remaining, rtol=1e-4, atol=1e-6)


def test_a_rotation_is_previewed_with_its_indirect_light(gathered, monkeypatch):
    monkeypatch.setattr("relume.live.fixed_camera.strategies.sparse_preview._NUM_SHADED", 300)
    picture = run_until_exact(Picture(gathered, "front", Cache(BUDGET)))

    def turn(document):
        document["environment"]["rotation"] = 90.0

    picture.set_look(make_look(gathered, turn))
    picture.advance(None)
    still, need = picture.image(), picture.next_job()
    assert kind_of(need) == "preview"
    need.apply(need.run(lambda fraction: None, lambda: False))
    assert not picture.advance(None).exact
    preview, exact = picture.image(), run_until_exact(picture).image()
    assert relative_rmse(preview, exact) < 0.7 * relative_rmse(still, exact)
