"""BTFs while the eye moves: texel by texel as the oracle has them, and near what a fixed view shows."""

from dataclasses import replace

import numpy as np
import pytest
from test_texels import CAMERA, GREY, SIZE, covered, floor, opened

from relume.basis.zernike import in_basis
from relume.btf.rings import directions, taps_numpy, ubo_rings
from relume.look import validate
from relume.moving import frame
from relume.moving.look_up import look
from relume.moving.relief import tables
from relume.moving.relief.light import light_about, light_about_numpy
from relume.moving.relief.show import Sight, show_texels
from relume.moving.relief.tables import NUM_FUNCTIONS, covers_of, hat_factors
from relume.render.image import render_image

SCALE, ROTATION = 2.0, 40.0
TO_LIGHT = np.array([0.5, 0.8, 0.2]) / np.linalg.norm([0.5, 0.8, 0.2])
BLACK = np.zeros((1, 3), np.float32)


@pytest.fixture(scope="module")
def moving(tmp_path_factory):
    return opened(floor(), tmp_path_factory.mktemp("moving"), "surface")


def sight(moving, pixel_angle=0.0):
    eye = CAMERA.to_world[:3, 3].astype(np.float32)
    return Sight(eye, pixel_angle, look(moving.surface, moving.embree, CAMERA, SIZE))


def vectors_of(surface, to_light):
    """Light vectors of all points in light from one side: of its functions, in the frame of each."""
    n, t = (getattr(surface.points, name).astype(np.float64) for name in ("normal", "tangent"))
    local = np.stack([t @ to_light, np.cross(n, t) @ to_light, n @ to_light], axis=1)
    return np.repeat(in_basis(local)[:, None], 3, axis=1).astype(np.float32)


def terms_of(look_of):
    return [[dict(term) for term in look_of.materials["Floor"].terms]]


def oracle(cover, d, place):
    """r of a ray on the floor, in plain NumPy: its texture's x to the right, y away from the eye."""
    turn, found = np.radians(ROTATION), cover.texels.btf.with_components(tables.COMPONENTS)
    x, y = np.array([1.0, 0, 0]), np.array([0, 0, -1.0])
    across, up = np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
    axes, (height, width) = np.array([across, up, [0, 1, 0]]), found.size
    column, row = SCALE * np.array([width * across @ place, -height * up @ place]) - 0.5
    values = np.zeros((81, 81, 3))
    for down, beside in ((0, 0), (0, 1), (1, 0), (1, 1)):
        share = abs(1 - beside - column % 1) * abs(1 - down - row % 1)
        number = int((np.floor(row) + down) % height * width + (np.floor(column) + beside) % width)
        values += share * found.texel(number)
    light = hat_factors(found.rings)[:, :NUM_FUNCTIONS] @ in_basis(axes @ TO_LIGHT)[:NUM_FUNCTIONS]
    view, of_view, _ = taps_numpy(found.rings, -(axes @ d)[None])

    def under(table):
        return np.einsum("a,alc,l->c", of_view[0], table[view[0]], light)

    return np.maximum(under(values), 0) / under(found.average.astype(np.float64))


def test_the_kernel_is_the_oracle(moving, small_btf):
    covers = covers_of(terms_of(covered(moving, small_btf.record, scale=SCALE, rotation=ROTATION)))
    seen_by, surface = sight(moving), moving.surface
    seen, out = seen_by.seen, np.ones((len(seen_by.seen.directions), 3), np.float32)
    show_texels(covers, surface, moving.positions, seen_by, vectors_of(surface, TO_LIGHT), BLACK, out)
    rays = np.flatnonzero(seen.hits.face >= 0)
    for ray in rays[::61]:
        d = seen.directions[ray].astype(np.float64)
        place = (seen_by.eye + seen.hits.distance[ray] * d + [1, 0, 1]) / 2
        np.testing.assert_allclose(out[ray], oracle(covers[0], d, place), rtol=5e-3, atol=2e-3)
    assert (out[seen.hits.face < 0] == 1).all()


def test_light_about_a_vertex_is_the_oracles(moving):
    """Of points whose tangents go any way about the normal."""
    rng, surface = np.random.default_rng(2), moving.surface
    turn = rng.uniform(0, 2 * np.pi, len(surface.points.normal))
    n, t = surface.points.normal, surface.points.tangent
    tangent = (np.cos(turn)[:, None] * t + np.sin(turn)[:, None] * np.cross(n, t)).astype(np.float32)
    surface = replace(surface, points=surface.points._replace(tangent=tangent))
    vectors = rng.normal(size=moving.vectors_shape).astype(np.float32)
    found = light_about(surface, vectors, np.ones(len(surface.vertices.normal), np.uint8))
    for vertex in range(0, len(found.tangent), 37):
        expected, along = light_about_numpy(surface.vertices, tangent, vectors, vertex)
        np.testing.assert_allclose(found.vectors[vertex], expected, rtol=1e-4, atol=1e-5)
        np.testing.assert_allclose(found.tangent[vertex], along)


def test_a_matt_surface_has_a_single_factor():
    """Its values are the cosine, ∫ cos θ h_k dω = √π for the first function and nothing for the others."""
    rings = ubo_rings()
    found = directions(rings)[:, 2] @ hat_factors(rings)
    assert found[0] == pytest.approx(np.sqrt(np.pi), rel=0.02)
    assert np.abs(found[1:]).max() < 0.02 * found[0]


def test_a_moving_view_shows_what_a_fixed_one_does(moving, small_btf, tmp_path, monkeypatch):
    look_of = covered(moving, small_btf.record, scale=SCALE)
    expected = render_image(opened(floor(), tmp_path), "front", look_of)
    found = render_image(moving, "front", look_of)
    monkeypatch.setattr(frame, "covers_of", lambda terms: [])
    mean = render_image(moving, "front", look_of)
    size = np.linalg.norm(expected)
    assert np.linalg.norm(found - expected) < 0.03 * size < 0.1 * size < np.linalg.norm(mean - expected)


def test_beside_other_terms_a_btf_counts_for_its_share(moving, small_btf, tmp_path):
    terms = [*terms_of(covered(moving, small_btf.record, color=(0.6, 0.3, 0.2), scale=SCALE))[0], GREY]
    document = {"materials": {"Floor": {"terms": terms}}}
    fixed = opened(floor(), tmp_path)
    expected = render_image(fixed, "front", validate(document, fixed.default_look))
    found = render_image(moving, "front", validate(document, moving.default_look))
    assert np.linalg.norm(found - expected) < 0.04 * np.linalg.norm(expected)


def test_emission_is_not_textured(moving, small_btf):
    covers, surface = covers_of(terms_of(covered(moving, small_btf.record, scale=SCALE))), moving.surface
    seen_by = sight(moving, 0.01)
    out = np.full((len(seen_by.seen.directions), 3), 0.7, np.float32)
    shining = np.full((1, 3), 0.7, np.float32)
    show_texels(covers, surface, moving.positions, seen_by, vectors_of(surface, TO_LIGHT), shining, out)
    np.testing.assert_allclose(out, 0.7, atol=1e-6)
