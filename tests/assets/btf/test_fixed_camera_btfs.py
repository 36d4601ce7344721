"""Images of BTFs: texel by texel against NumPy, and against the values before compression."""

from dataclasses import replace

import numpy as np
import pytest
from btf_reference import outgoing_radiance_numpy, sample_btf_numpy
from session_edits import run_until_exact
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere, studio

from relume.assets.btf.direction_rings import interpolation_weights_numpy
from relume.brdf.evaluate import eval_brdf
from relume.brdf.registry import TERMS
from relume.brdf.terms.btf import BtfRef
from relume.core.cache import Cache
from relume.live.fixed_camera.illumination import illumination_from_look
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_bake
from relume.look import validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.reference import ReferencePoints, reference_image
from relume.reference.lobes import cosine_lobe
from relume.reference.path_tracing import _sample_btf_surfaces, _sample_directions
from relume.reference.roughness_classes import RoughnessClasses
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume.transport.btf_kernel import _MAX_FOOTPRINT_SAMPLES, _MAX_SPACING, F64, texel_rows

CAMERA = make_camera("front", [0.3, 1.6, 1.9], [0, 0, 0], 0.5)
GRAY = {"model": "lambert", "color": [0.5, 0.5, 0.5]}
SIZE = (48, 36)


def texel_numpy(
    btf_ref: BtfRef, directions: F64, irradiance: F64, wo: F64, texel_position: F64, footprint: float = 0.0
) -> F64:
    """Reference of `texel_rows` for one point under given lights, in plain NumPy.

    Args:
        btf_ref: the BTF with its mapping. directions: to lights, in the texture's frame, unit. (m, 3)
        irradiance: of each light, perpendicular to its direction. (m, 3)
        wo: view direction, in the texture's frame. (3,)
        texel_position: column and row, in texels of the finest level, from the center of the first.
        footprint: side of a square of the pixel's area, in texels; at most two texels wide at grazing angles.
    Returns:
        (3,) float64
    """
    length = footprint / np.sqrt(wo[2])
    num = 1 if length**2 <= 3 else int(np.clip(np.ceil(length / _MAX_SPACING), 2, _MAX_FOOTPRINT_SAMPLES))
    spacing = np.sqrt((length**2 - 3) / (num**2 - 1)) if num > 1 else 0.0
    offset = spacing * (np.arange(num) - (num - 1) / 2)
    positions = texel_position + offset[:, None] * wo[:2] / np.hypot(wo[0], wo[1]) * [1, -1]
    outgoing = outgoing_radiance_numpy(btf_ref.btf, sample_btf_numpy(btf_ref.btf, positions, wo), directions)
    return np.asarray((outgoing * irradiance).sum(axis=0).clip(0))


def floor():
    ground = quad("floor", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0)
    return make_tiny_scene(ground, camera=CAMERA, environment=studio(32, 20.0), materials=[Material("Floor", (GRAY,))])


def opened(scene, folder, method="direct"):
    recipe = Recipe(method, ("front",), SIZE, 300, num_probes=800)
    return open_bake(bake_in_process(METHODS[method], scene, recipe, folder / f"{method}.zarr"), Cache(1 << 30))


def covered(bake, record, color=(1, 1, 1), **params):
    term = {"model": "measured_btf", "data": record.data, "texture": None, "color": list(color), "params": params}
    return validate({"materials": {"Floor": {"terms": [term]}}}, bake.default_look)


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    return opened(floor(), tmp_path_factory.mktemp("floor"))


def exact_picture(record, **params):
    document = {"model": "measured_btf", "data": record.data, "params": params}
    return TERMS["measured_btf"].normalized(document)


def incident_light(bake, look, footprint=0.0):
    """Incident light at the floor and its position in texels of the finest level."""
    light = illumination_from_look(look, bake.material_names, has_bounces=False)
    lights, receivers = bake.incident_light(bake.samples(bake.views["front"], 0, bake.cache), light)
    uv = np.array(receivers.uv)
    uv[:, 2] = footprint
    return lights, replace(receivers, read_uv=lambda: uv)


@pytest.mark.parametrize(("rotation", "footprint"), [(0.0, 0.0), (50.0, 0.0), (50.0, 2.0)])
def test_the_fixed_camera_kernel_equals_the_reference(bake, small_btf, rotation, footprint):
    """The floor's texture: x to the right, y away from the camera, v = 0 at z = −1."""
    look = covered(bake, small_btf.record, scale=3.0, rotation=rotation)
    texels = exact_picture(small_btf.record, scale=3.0, rotation=rotation).texels
    lights, receivers = incident_light(bake, look, footprint / (3 * texels.btf.size[0]))
    rows = texel_rows(texels, lights, receivers, 0, len(receivers.uv))
    turn, (height, width) = np.radians(rotation), texels.btf.size
    x, y = np.array([1.0, 0, 0]), np.array([0, 0, -1.0])
    across, up = np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
    axes = np.array([across, up, [0, 1, 0]])
    for point in range(0, len(rows), 97):
        visible = np.unpackbits(receivers.visible[point], count=lights.num_lights, bitorder="little").astype(bool)
        from_corner = (receivers.points.position[point].astype(np.float64) + np.array([1, 0, 1])) / 2
        texel_position = 3 * np.array([width * across @ from_corner, -height * up @ from_corner]) - 0.5
        expected = texel_numpy(
            texels,
            lights.direction[visible] @ axes.T,
            lights.irradiance[visible],
            axes @ receivers.wo[point],
            texel_position,
            footprint,
        )
        np.testing.assert_allclose(rows[point], expected, rtol=2e-3, atol=1e-4)


def test_an_image_equals_that_of_the_values_before_compression(bake, small_btf):
    """At equal positions and lights, with each texel's own values instead of its cluster's."""
    look = covered(bake, small_btf.record, scale=1.0)
    lights, receivers = incident_light(bake, look)
    uv = np.array(receivers.uv)
    (height, width), texels = small_btf.values.size, exact_picture(small_btf.record, scale=1.0).texels
    flat = replace(texels.btf, height=np.zeros((1, 1), np.float32))  # no parallax
    texels = replace(texels, btf=flat)
    # at texel centers, so that no filter is included
    uv[:, 0] = (np.floor(uv[:, 0] * width) + 0.5) / width
    uv[:, 1] = (np.floor(uv[:, 1] * height) + 0.5) / height
    rows = texel_rows(texels, lights, replace(receivers, read_uv=lambda: uv), 0, len(uv))
    axes = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1, 0]])
    light, of_light, left = interpolation_weights_numpy(small_btf.values.grid, lights.direction @ axes.T)
    view, of_view, _ = interpolation_weights_numpy(small_btf.values.grid, receivers.wo.astype(np.float64) @ axes.T)
    visible = np.unpackbits(receivers.visible, axis=1, count=lights.num_lights, bitorder="little")
    values = [small_btf.values.get_view(v).astype(np.float64) for v in range(81)]
    texel = (np.floor(uv[:, 1] * height) % height * width + np.floor(uv[:, 0] * width) % width).astype(int)
    expected = np.zeros_like(rows, dtype=np.float64)
    for point in range(len(rows)):
        of_texel = sum(w * values[v][:, texel[point]] for v, w in zip(view[point], of_view[point], strict=True))
        for_lights = np.einsum("mk,mkc->mc", of_light, of_texel[light]) * left[:, None]
        expected[point] = (visible[point, :, None] * for_lights * lights.irradiance).sum(axis=0)
    assert np.linalg.norm(rows - expected) < 0.025 * np.linalg.norm(expected)


def test_the_mean_of_the_texels_is_a_brdf(small_btf):
    """Distant images and indirect light use it."""
    document = {"model": "measured_btf", "data": small_btf.record.data, "color": [1, 1, 1], "params": {}}
    rng = np.random.default_rng(4)
    wi, wo = (np.abs(rng.normal(size=(50, 3))) + np.array([0, 0, 0.4]) for _ in range(2))
    wi, wo = (w / np.linalg.norm(w, axis=1, keepdims=True) for w in (wi, wo))
    actual = eval_brdf(document, wi, wo)
    average = sum(
        small_btf.values.get_view(v).mean(axis=1)[None] * (np.arange(81) == v)[:, None, None] for v in range(81)
    )
    light, of_light, left = interpolation_weights_numpy(small_btf.values.grid, wi)
    view, of_view, _ = interpolation_weights_numpy(small_btf.values.grid, wo)
    expected = np.einsum("na,nb,nabc->nc", of_view, of_light, average[view[:, :, None], light[:, None]])
    expected *= (left / wi[:, 2])[:, None]
    np.testing.assert_allclose(actual, expected, rtol=0.03, atol=1e-3)
    assert not eval_brdf(document, wi * [1, 1, -1], wo).any()


def test_a_distant_btf_is_the_mean_of_its_texels(bake, small_btf):
    """A footprint of many repeats selects the coarsest level, which does not depend on the position."""
    lights, receivers = incident_light(bake, covered(bake, small_btf.record))
    uv = np.array(receivers.uv)
    uv[:, 2] = 5
    texels = exact_picture(small_btf.record).texels
    rows = texel_rows(texels, lights, replace(receivers, read_uv=lambda: uv), 0, len(uv))
    uv[:, :2] += 0.37
    other = texel_rows(texels, lights, replace(receivers, read_uv=lambda: uv), 0, len(uv))
    np.testing.assert_allclose(rows, other, rtol=1e-4, atol=1e-6)


def test_quality_scale_and_rotation_change_the_picture_and_tint_is_a_factor(bake, small_btf):
    pictures = [
        render_image(bake, "front", covered(bake, small_btf.record, **params))
        for params in (
            {"scale": 2.0},
            {"scale": 4.0},
            {"scale": 2.0, "rotation": 90.0},
            {"scale": 2.0, "components": 0},
        )
    ]
    for other in pictures[1:]:
        assert np.linalg.norm(other - pictures[0]) > 0.02 * np.linalg.norm(pictures[0])
    tinted = render_image(bake, "front", covered(bake, small_btf.record, (2.0, 1.0, 0.5), scale=2.0))
    covered_pixels = pictures[0].min(axis=2) > 0.01
    ratio = (tinted / np.maximum(pictures[0], 1e-6))[covered_pixels]
    np.testing.assert_allclose(np.median(ratio, axis=0), [2, 1, 0.5], rtol=0.01)


def test_surfaces_without_uv_coordinates_use_triplanar_mapping(small_btf, tmp_path):
    """A ball without UV coordinates is mapped on all sides, in meters."""
    ball = sphere("ball", [0, 0, 0], 0.6, 0, 16)
    bare = type(ball)(**{**vars(ball), "uvs": np.zeros_like(ball.uvs)})
    scene = make_tiny_scene(bare, camera=CAMERA, environment=studio(32, 20.0), materials=[Material("Floor", (GRAY,))])
    bake = opened(scene, tmp_path)
    _, receivers = incident_light(bake, covered(bake, small_btf.record))
    position = receivers.points.position
    near = np.linalg.norm(position[1:] - position[:-1], axis=1)
    apart = np.linalg.norm(receivers.uv[1:, :2] - receivers.uv[:-1, :2], axis=1)
    same_side = np.abs(receivers.normal[1:]).argmax(axis=1) == np.abs(receivers.normal[:-1]).argmax(axis=1)
    assert (apart[same_side & (near < 0.1)] <= near[same_side & (near < 0.1)] * 1.05 + 2e-3).mean() > 0.9
    assert np.isfinite(render_image(bake, "front", covered(bake, small_btf.record, scale=3.0))).all()


@pytest.mark.parametrize("method", ["gather", "probes"])
def test_other_methods_show_btfs_and_follow_edits(small_btf, tmp_path, method):
    bake = opened(floor(), tmp_path, method)
    picture = render_image(bake, "front", covered(bake, small_btf.record, scale=3.0))
    assert np.isfinite(picture).all()
    assert picture[..., :3].mean() > 0.01
    if method == "probes":
        return
    live = Picture(bake, "front", bake.cache)
    live.set_look(covered(bake, small_btf.record, scale=3.0))
    run_until_exact(live)
    for red in (0.8, 0.4):  # indirect light is updated by transport rows of a term without curves
        look = covered(bake, small_btf.record, (red, 1, 1), scale=3.0)
        live.set_look(look, active_pointer="/materials/Floor/terms/0/color")
        while (job := live.next_job()) is not None:
            job.apply(job.run(lambda fraction: None, lambda: False))
        live.advance(None)
        live.set_look(look)
        run_until_exact(live)
        np.testing.assert_allclose(
            live.image()[..., :3], render_image(bake, "front", look)[..., :3], rtol=1e-4, atol=1e-5
        )


def test_the_reference_samples_positions_within_the_pixel_footprint(bake, small_btf):
    """Its direct image equals the method's, except for detail that filtering removes."""
    look = covered(bake, small_btf.record, (1.0, 0.8, 0.6), scale=3.0, rotation=20.0)
    ours = render_image(bake, "front", look)[..., :3]
    reference = reference_image(floor(), "front", look, SIZE, 0)
    on_floor = reference.min(axis=2) > 0.01
    assert np.linalg.norm(ours - reference) < 0.06 * np.linalg.norm(reference)
    assert np.linalg.norm((ours - reference)[on_floor]) < 0.3 * np.linalg.norm(
        (reference - reference[on_floor].mean(axis=0))[on_floor]
    )


def test_reference_paths_start_at_sampled_positions(bake, small_btf):
    """Sampled directions over their density average to the hemispherical integral of uniform light."""
    (term,) = covered(bake, small_btf.record, (1.0, 0.8, 0.6)).materials["Floor"].terms
    kinds, num = RoughnessClasses([[term]], [[np.zeros(3)]], [0], [()]), 400
    rows = np.ones((num, 1), np.float32)
    wo = np.array([0.48, 0.6, 0.64])
    places = np.array([[0.31, 0.77, 0.0, 0.4, -1.0]])
    points = ReferencePoints(
        0 * rows * [1, 1, 1], rows * [0, 0, 1], rows * [1, 0, 0], rows * wo, {}, rows[:, 0], (rows * places).astype("f")
    )
    materials, rng = np.zeros(num, np.int64), np.random.default_rng(5)
    covers = _sample_btf_surfaces(kinds, points, materials, 1)
    _, fraction, _ = _sample_directions(kinds, [[cosine_lobe()]], points, materials, covers, rng)
    z, turn = (np.arange(40) + 0.5) / 40, (np.arange(80) + 0.5) * np.pi / 40
    flat = np.sqrt(1 - z**2)[:, None]
    wi = np.stack([flat * np.cos(turn), flat * np.sin(turn), np.broadcast_to(z[:, None], (40, 80))], axis=-1)
    expected = 2 * np.pi * covers[0, 0].evaluate(np.full(3200, 7), wi.reshape(-1, 3)).mean(axis=0) * term["color"]
    error = fraction.std(axis=0) / np.sqrt(num)
    assert (np.abs(fraction.mean(axis=0) - expected) < 4 * error).all()
    assert (error < 0.04 * expected).all()
    mean = _sample_directions(kinds, [[cosine_lobe()]], points, materials, {}, rng)[1].mean(axis=0)
    assert np.linalg.norm(mean - expected) > 8 * np.linalg.norm(error)  # the mean over all texels is different
