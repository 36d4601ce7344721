"""BTFs with a free camera: texel by texel against NumPy, and near fixed views."""

from dataclasses import replace

import numpy as np
import pytest
from btf_reference import parallax_intersection_numpy
from numpy.typing import NDArray
from test_fixed_camera_btfs import CAMERA, GRAY, SIZE, covered, floor, opened

from relume.assets.btf.btf_store import load_btf
from relume.assets.btf.direction_rings import directions, interpolation_weights_numpy, ubo_grid
from relume.assets.btf.parallax import compute_shears
from relume.live.free_camera import frame
from relume.live.free_camera.primary_visibility import trace_primary
from relume.live.free_camera.texel_brdf import texel_tables
from relume.live.free_camera.texel_brdf.coefficient_packing import COEFFICIENT_AXIS, COEFFICIENT_LANE, FUNCTIONS
from relume.live.free_camera.texel_brdf.shade_texels import IncidentTexelLight, TextureFootprint, shade_texels
from relume.live.free_camera.texel_brdf.texel_tables import (
    BtfMaterials,
    filtered_factors,
    find_btf_materials,
    pack_lanes,
)
from relume.live.free_camera.texel_brdf.texture_frame_light import F32, TexelLight, TexelSource
from relume.live.free_camera.texel_brdf.visible_relief import NUM_FETCHES, see_relief, visible_height
from relume.look import validate
from relume.math.zernike import basis_functions, recurrence
from relume.output.render_image import render_image
from relume.probes.lattice_nodes import LatticeNodes

SCALE, ROTATION, MEAN = 2.0, 40.0, np.float32(0.02)
TO_LIGHT = np.array([0.5, 0.8, 0.2]) / np.linalg.norm([0.5, 0.8, 0.2])
CONSTANT = int(np.flatnonzero(FUNCTIONS == 0)[0])


def node_light_numpy(
    lattice_nodes: LatticeNodes, tangents: F32, vectors: F32, lattice_node: int
) -> tuple[NDArray[np.float64], F32]:
    """Reference of `TexelLight.around_nodes` for one node, in plain NumPy.

    Args:
        lattice_nodes: all. tangents, vectors: of probes, (probes, 3), (probes, 3, K). lattice_node: its index.
    Returns:
        Its incident radiance coefficients (3, K), its tangent (3,).
    """
    recurrence_table, weights, probes = (
        recurrence(),
        lattice_nodes.weight[lattice_node],
        lattice_nodes.probe[lattice_node],
    )
    n, t = lattice_nodes.normal[lattice_node], tangents[probes[weights.argmax()]]
    out = np.zeros(vectors.shape[1:])
    for weight, probe in zip(weights, probes, strict=True):
        angle = np.arctan2(tangents[probe] @ np.cross(n, t), tangents[probe] @ t)
        for m, cosine, sine in zip(recurrence_table.order, recurrence_table.cosine, recurrence_table.sine, strict=True):
            phase = vectors[probe, :, cosine] + 1j * (vectors[probe, :, sine] if m else 0)
            phase = weight * phase * np.exp(1j * m * angle)
            out[:, sine] += phase.imag
            out[:, cosine] += phase.real
    return out, t


@pytest.fixture(scope="module")
def free_bake(tmp_path_factory):
    return opened(floor(), tmp_path_factory.mktemp("moving"), "probes")


def sight(free_bake, pixel_angle=0.0):
    camera_position = CAMERA.to_world[:3, 3].astype(np.float32)
    return TextureFootprint(
        camera_position, pixel_angle, trace_primary(free_bake.stored_scene, free_bake.embree, CAMERA, SIZE)
    )


def vectors_of(surface, to_light):
    """Incident radiance coefficients of all probes for light from one direction, in the frame of each probe."""
    n, t = (getattr(surface.probes, name).astype(np.float64) for name in ("normal", "tangent"))
    local = np.stack([t @ to_light, np.cross(n, t) @ to_light, n @ to_light], axis=1)
    return np.repeat(basis_functions(local)[:, None], 3, axis=1).astype(np.float32)


def terms_of(look_of):
    return [[dict(term) for term in look_of.materials["Floor"].terms]]


def incident_light(surface):
    return IncidentTexelLight([TexelSource(vectors_of(surface, TO_LIGHT))], TexelLight())


def factors(numbers, axes):
    """Outgoing coefficients, in lanes, of compressed numbers. (…, 24) to (…, 3, F)"""
    out = np.zeros((*numbers.shape[:-1], 3, 16))
    for number, (axis, lane) in enumerate(zip(COEFFICIENT_AXIS, COEFFICIENT_LANE, strict=True)):
        out[..., lane] += numbers[..., number, None] * axes[:, axis]
    return out


def visible_height_numpy(relief, view, uv, wo):
    """Reference of `visible_height` at the finest level."""
    change = (wo[:2] / wo[2] - relief.shear[view]) * [1, -1]
    (_, rows, columns), height = relief.levels[0], float(relief.lowest + 255 * relief.step)
    for _ in range(NUM_FETCHES):
        column, row = (np.floor((uv + height * change) * [columns, rows]) % [columns, rows]).astype(int)
        height = float(relief.lowest + relief.step * relief.height[view, row * columns + column])
    return height


def shade_ray_numpy(cover, d, position):
    """Reference of a ray on the floor, minus the mean, in plain NumPy; its texture's x is to the right, y away."""
    turn, tables = np.radians(ROTATION), cover.tables
    x, y = np.array([1.0, 0, 0]), np.array([0, 0, -1.0])
    across, up = np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
    axes, size = np.array([across, up, [0, 1, 0]]), np.array(cover.texels.btf.size[::-1])
    wo, uv, total = -(axes @ d), SCALE * np.array([across @ position, -up @ position]), np.zeros(3)
    light = pack_lanes(basis_functions(axes @ TO_LIGHT))
    view, of_view, _ = interpolation_weights_numpy(cover.texels.btf.grid, wo[None])
    height = visible_height_numpy(tables.relief, view[0, of_view[0].argmax()], uv, wo)
    for side, weight in zip(view[0], of_view[0], strict=True):
        column, row = size * (uv + height * (wo[:2] / wo[2] - tables.relief.shear[side]) * [1, -1]) - 0.5
        numbers = np.zeros(tables.step.shape[1])
        for down, beside in ((0, 0), (0, 1), (1, 0), (1, 1)):
            fraction = abs(1 - beside - column % 1) * abs(1 - down - row % 1)
            number = int((np.floor(row) + down) % size[1] * size[0] + (np.floor(column) + beside) % size[0])
            numbers += fraction * tables.step[side] * tables.weight[side, number].astype(float)
        total += weight * factors(numbers, tables.axes) @ light
    return total


def test_the_free_camera_kernel_equals_the_reference(free_bake, small_btf):
    look_of = covered(free_bake, small_btf.record, (0.5, 1.0, 2.0), scale=SCALE, rotation=ROTATION)
    covers, view, surface = find_btf_materials(terms_of(look_of)).available, sight(free_bake), free_bake.stored_scene
    gbuffer, out = view.gbuffer, np.full((len(view.gbuffer.directions), 3), MEAN, np.float32)
    shade_texels(covers, surface, free_bake.positions, view, incident_light(surface), out)
    rays = np.flatnonzero(gbuffer.hits.face >= 0)
    num_pixels = len(gbuffer.directions) - len(gbuffer.owner)
    assert len(gbuffer.owner)
    for ray in rays[::61]:
        center = ray if ray < num_pixels else gbuffer.owner[ray - num_pixels]
        texel_of = center if gbuffer.hits.face[center] >= 0 else ray  # across an edge: as at the pixel center
        d = gbuffer.directions[texel_of].astype(np.float64)
        position = (view.camera_position + gbuffer.hits.distance[texel_of] * d + [1, 0, 1]) / 2
        more = [0.5, 1.0, 2.0] * shade_ray_numpy(covers[0], d, position)
        np.testing.assert_allclose(out[ray], np.maximum(MEAN + more, 0), rtol=5e-3, atol=2e-4)
    assert (out[gbuffer.hits.face < 0] == MEAN).all()
    assert (out[rays] == 0).any()
    assert out.max() > 2 * MEAN


def test_light_around_a_node_equals_the_reference(free_bake):
    """For probes whose tangents have any azimuth."""
    rng, surface = np.random.default_rng(2), free_bake.stored_scene
    turn = rng.uniform(0, 2 * np.pi, len(surface.probes.normal))
    n, t = surface.probes.normal, surface.probes.tangent
    tangent = (np.cos(turn)[:, None] * t + np.sin(turn)[:, None] * np.cross(n, t)).astype(np.float32)
    surface = replace(surface, probes=surface.probes._replace(tangent=tangent))
    vectors = rng.normal(size=free_bake.vectors_shape).astype(np.float32)
    light, num = TexelLight(), len(surface.lattice_nodes.normal)
    light.around_nodes(surface, [TexelSource(vectors)], np.arange(num, dtype=np.uint8) % 2)
    actual = light.around_nodes(surface, [TexelSource(vectors)], np.ones(num, np.uint8))
    for vertex in range(0, len(actual.tangent), 37):
        expected, along = node_light_numpy(surface.lattice_nodes, tangent, vectors, vertex)
        np.testing.assert_allclose(
            actual.vectors[vertex].reshape(2, 3, 8).swapaxes(0, 1).reshape(3, 16),
            pack_lanes(expected),
            rtol=1e-4,
            atol=1e-5,
        )
        np.testing.assert_allclose(actual.tangent[vertex], along)


def test_changed_light_is_not_taken_from_the_cache(free_bake):
    """Cached light of the previous look is not shown."""
    surface, light, every = (
        free_bake.stored_scene,
        TexelLight(),
        np.ones(len(free_bake.stored_scene.lattice_nodes.normal), np.uint8),
    )
    dark, bright = np.zeros(free_bake.vectors_shape, np.float32), np.ones(free_bake.vectors_shape, np.float32)
    assert light.around_nodes(surface, [TexelSource(bright)], every).vectors.any()
    assert not light.around_nodes(surface, [TexelSource(dark)], every).vectors.any()
    assert not light.around_nodes(surface, [TexelSource(bright, (0.0, 0.0, 0.0))], every).vectors.any()


def test_texels_show_the_visible_fraction_of_each_hard_shadow_light(free_bake, small_btf):
    """The result is linear in the visible fractions, also for rays of one pixel on both sides of a shadow's edge."""
    covers = find_btf_materials(terms_of(covered(free_bake, small_btf.record, scale=SCALE))).available
    surface, view = free_bake.stored_scene, sight(free_bake)
    vectors, gain = vectors_of(surface, TO_LIGHT), (0.5, 1.0, 2.0)
    fractions = np.random.default_rng(3).random((2, len(view.gbuffer.directions))).astype(np.float32)

    def relief(*sources):
        out = np.full((len(view.gbuffer.directions), 3), 1e2, np.float32)
        shade_texels(covers, surface, free_bake.positions, view, IncidentTexelLight(sources, TexelLight()), out)
        return out - 1e2

    dark = TexelSource(np.zeros_like(vectors))
    whole = relief(TexelSource(vectors, gain), TexelSource(vectors, gain, np.zeros_like(fractions[0])))
    actual = relief(dark, *(TexelSource(vectors, gain, each) for each in fractions))
    centers = slice(len(view.gbuffer.directions) - len(view.gbuffer.owner))
    np.testing.assert_allclose(actual[centers], fractions.sum(axis=0)[centers, None] * whole[centers], atol=2e-4)
    assert np.abs(whole[centers]).max() > 0.01


def test_compressed_outgoing_coefficients_are_accurate(free_bake, small_btf):
    """For each texel and direction, except for rounding and for colors of narrow lobes."""
    cover = find_btf_materials(terms_of(covered(free_bake, small_btf.record))).available[0]
    whole, tables, bins = cover.texels.btf, cover.tables, np.zeros(2)
    integrals = filtered_factors(whole.grid)
    mean = np.einsum("vlc,lk->vck", whole.average, integrals)
    for texel in range(0, tables.weight.shape[1], 29):
        expected = np.einsum("vlc,lk->vck", whole.texel_brdf(texel), integrals)
        represented = mean + factors(tables.step * tables.weight[:, texel], tables.axes)
        bins += np.sum((represented - expected) ** 2), np.sum(expected**2)
    assert bins[0] < 0.05**2 * bins[1]


def test_large_tables_omit_the_finest_level(small_btf, monkeypatch):
    whole = load_btf(small_btf.record.data)
    monkeypatch.setattr(texel_tables, "_MAX_TABLE_BYTES", 81 * 24 * 100)
    tables = texel_tables.compute_texel_tables(whole)
    assert tables.levels[0].tolist() == [0, 8, 8]
    assert tables.weight.shape[1] == 64 + 16 + 4 + 1
    monkeypatch.undo()
    complete = texel_tables.compute_texel_tables(whole)
    actual, expected = (t.step[:, None] * t.weight for t in (tables, complete))
    np.testing.assert_allclose(actual, expected[:, 256:], atol=float((tables.step + complete.step).max()))


def test_a_diffuse_surface_has_a_single_coefficient():
    """Its values are the cosine: ∫ cos θ h_k dω = √π for the first function and 0 for the others."""
    rings = ubo_grid()
    coefficients = directions(rings)[:, 2] @ filtered_factors(rings)
    assert coefficients[CONSTANT] == pytest.approx(np.sqrt(np.pi), rel=0.02)
    assert np.abs(np.delete(coefficients, CONSTANT)).max() < 0.02 * coefficients[CONSTANT]


def test_a_free_camera_equals_a_fixed_view(free_bake, small_btf, tmp_path, monkeypatch):
    look_of = covered(free_bake, small_btf.record, scale=SCALE)
    expected = render_image(opened(floor(), tmp_path), "front", look_of)
    actual = render_image(free_bake, "front", look_of)
    monkeypatch.setattr(frame, "find_btf_materials", lambda *_, **__: BtfMaterials([], []))
    mean = render_image(free_bake, "front", look_of)
    size = np.linalg.norm(expected)
    assert np.linalg.norm(actual - expected) < 0.03 * size < 0.1 * size < np.linalg.norm(mean - expected)


def test_view_directions_see_the_relief(small_btf):
    """Seen heights at the centers of texels are those of rays, within half a step; coarser levels store their means."""
    whole = load_btf(small_btf.record.data)
    relief, shears = texel_tables.compute_texel_tables(whole).relief, compute_shears(whole.grid)
    rows, columns = whole.size
    heights = relief.lowest + relief.step * relief.height.astype(np.float64)
    for view, texel in ((0, 5), (3, 100), (40, 77), (80, 200), (80, 13)):
        center = (np.array([texel % columns, texel // columns]) + 0.5) / [columns, rows]
        expected = parallax_intersection_numpy(whole.height, center, shears[view].astype(np.float64))
        assert heights[view, texel] == pytest.approx(expected, abs=0.51 * float(relief.step) + 1e-5)
    finest = heights[:, : rows * columns].reshape(len(shears), rows, columns)
    means = 0.25 * sum(finest[:, a::2, b::2] for a in (0, 1) for b in (0, 1))
    second = heights[:, rows * columns : rows * columns * 5 // 4].reshape(means.shape)
    np.testing.assert_allclose(second, means, atol=1.01 * relief.step)


def test_relief_is_found_between_view_directions(small_btf):
    """A stored view shows what a ray meets near the point that a march along the ray finds."""
    whole, rng = load_btf(small_btf.record.data), np.random.default_rng(5)
    relief, shears, (rows, columns) = see_relief(whole, whole.levels), compute_shears(whole.grid), whole.size
    found, missed = [], []
    for uv, theta, phi in zip(rng.random((200, 2)), rng.uniform(0.2, 1.1, 200), rng.uniform(0, 6.28, 200), strict=True):
        wo = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
        height = parallax_intersection_numpy(whole.height, uv, wo[:2] / wo[2])
        view = interpolation_weights_numpy(whole.grid, wo[None])[0][0, 0]
        change = (wo[:2] / wo[2] - shears[view]) * [1, -1]
        found_height = visible_height.py_func(relief, 0, view, *np.float32(uv), *np.float32(wo[:2] / wo[2]))
        found.append(np.linalg.norm((found_height - height) * change * [columns, rows]))
        missed.append(np.linalg.norm(height * change * [columns, rows]))
    assert np.median(found) < 0.1
    assert np.mean(found) < 0.5 * np.mean(missed)


def test_a_btf_is_weighted_next_to_other_terms(free_bake, small_btf, tmp_path):
    terms = [*terms_of(covered(free_bake, small_btf.record, color=(0.6, 0.3, 0.2), scale=SCALE))[0], GRAY]
    document = {"materials": {"Floor": {"terms": terms}}}
    fixed = opened(floor(), tmp_path)
    expected = render_image(fixed, "front", validate(document, fixed.default_look))
    actual = render_image(free_bake, "front", validate(document, free_bake.default_look))
    assert np.linalg.norm(actual - expected) < 0.04 * np.linalg.norm(expected)


def test_two_textures_on_one_material_are_summed(free_bake, small_btf):
    terms = terms_of(covered(free_bake, small_btf.record, scale=SCALE))
    view, surface = sight(free_bake), free_bake.stored_scene
    images = []
    for times in (1, 2):
        out = np.full((len(view.gbuffer.directions), 3), 10.0, np.float32)
        shade_texels(
            find_btf_materials([terms[0] * times]).available,
            surface,
            free_bake.positions,
            view,
            incident_light(surface),
            out,
        )
        images.append(out - 10)
    np.testing.assert_allclose(images[1], 2 * images[0], atol=1e-5)
