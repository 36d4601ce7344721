"""BTFs while the eye moves: texel by texel as the oracle has them, and nearer to a fixed view than their mean is."""

import numpy as np
import pytest
from test_texels import CAMERA, SIZE, covered, floor, opened

from relume.btf.rings import directions, taps_numpy, ubo_rings
from relume.moving import frame, relief
from relume.moving.look_up import look
from relume.moving.relief import covers_of, show_texels
from relume.render.image import render_image

SCALE, ROTATION = 2.0, 40.0


@pytest.fixture(scope="module")
def moving(tmp_path_factory):
    return opened(floor(), tmp_path_factory.mktemp("moving"), "surface")


def oracle(cover, d, to_light, place):
    """r of a ray on the floor, in plain NumPy: its texture's x to the right, y away from the eye."""
    turn, found = np.radians(ROTATION), cover.texels.btf.with_components(relief._COMPONENTS)
    x, y = np.array([1.0, 0, 0]), np.array([0, 0, -1.0])
    across, up = np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
    axes, (height, width) = np.array([across, up, [0, 1, 0]]), found.size
    column, row = SCALE * np.array([width * across @ place, -height * up @ place]) - 0.5
    values = np.zeros((81, 81, 3))
    for down, beside in ((0, 0), (0, 1), (1, 0), (1, 1)):
        share = abs(1 - beside - column % 1) * abs(1 - down - row % 1)
        values += share * found.texel(
            int((np.floor(row) + down) % height * width + (np.floor(column) + beside) % width)
        )
    to_light = axes @ to_light / np.linalg.norm(to_light)
    view, of_view, _ = taps_numpy(found.rings, -(axes @ d)[None])
    light, of_light, left = taps_numpy(found.rings, to_light[None])
    leaning, sky = np.sqrt(1 - to_light[2] ** 2), relief._open_sky(found.rings).astype(np.float64)

    def under(table):
        from_one = left[0] * np.einsum("l,vlc->vc", of_light[0], table[view[0]][:, light[0]])
        return of_view[0] @ ((1 - leaning) * np.einsum("vlc,l->vc", table[view[0]], sky) + leaning * from_one)

    return np.maximum(under(values), 0) / under(cover.tables.mean.astype(np.float64))


def test_the_kernel_is_the_oracle(moving, small_btf):
    look_of = covered(moving, small_btf.record, scale=SCALE, rotation=ROTATION)
    covers = covers_of([[dict(term) for term in look_of.materials["Floor"].terms]])
    surface, eye = moving.surface, CAMERA.to_world[:3, 3].astype(np.float32)
    seen = look(surface, moving.embree, CAMERA, SIZE)
    to_light = np.array([0.5, 0.8, 0.2], np.float32)
    towards = np.tile(to_light, (len(surface.vertices.normal), 1))
    out = np.ones((len(seen.directions), 3), np.float32)
    show_texels(covers, surface, moving.positions, seen, eye, 0.0, towards, np.zeros((1, 3), np.float32), out)
    rays = np.flatnonzero(seen.hits.face >= 0)
    for ray in rays[::61]:
        d = seen.directions[ray].astype(np.float64)
        place = (eye + seen.hits.distance[ray] * d + [1, 0, 1]) / 2
        np.testing.assert_allclose(out[ray], oracle(covers[0], d, to_light, place), rtol=5e-3, atol=2e-3)
    assert (out[seen.hits.face < 0] == 1).all()


def test_a_sky_that_is_bright_all_over_is_all_of_it():
    share = relief._open_sky(ubo_rings())
    cosine = directions(ubo_rings())[:, 2]
    assert share @ cosine == pytest.approx(np.pi, rel=0.02)  # of a matt surface, whose values are the cosine
    assert share.min() > 0


def test_a_moving_view_shows_texels_and_not_their_mean(moving, small_btf, tmp_path, monkeypatch):
    look_of = covered(moving, small_btf.record, scale=SCALE)
    expected = render_image(opened(floor(), tmp_path), "front", look_of)
    found = render_image(moving, "front", look_of)
    monkeypatch.setattr(frame, "covers_of", lambda terms: {})
    mean = render_image(moving, "front", look_of)
    assert np.linalg.norm(found - expected) < 0.85 * np.linalg.norm(mean - expected)
    relief_of = [(picture - mean)[SIZE[1] // 2 :].ravel() for picture in (found, expected)]
    assert np.corrcoef(*relief_of)[0, 1] > 0.7


def test_emission_is_not_textured(moving, small_btf):
    look_of = covered(moving, small_btf.record, scale=SCALE)
    covers = covers_of([[dict(term) for term in look_of.materials["Floor"].terms]])
    surface = moving.surface
    seen = look(surface, moving.embree, CAMERA, SIZE)
    towards = np.tile(np.array([0, 1, 0], np.float32), (len(surface.vertices.normal), 1))
    out = np.full((len(seen.directions), 3), 0.7, np.float32)
    shining = np.full((1, 3), 0.7, np.float32)
    eye = CAMERA.to_world[:3, 3].astype(np.float32)
    show_texels(covers, surface, moving.positions, seen, eye, 0.01, towards, shining, out)
    np.testing.assert_allclose(out, 0.7, atol=1e-6)
