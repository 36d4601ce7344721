"""Cells under an image of normals: they lean as their texels do, and their rays are traced about the normal."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from relume.brdf.texture_slots import IMAGES, NormalMap
from relume.core.errors import CancelledError
from relume.images.image_store import store
from relume.patches.patches import patch_sample_points
from relume.radiosity.normal_mapped_patches import normal_mapped_patches
from relume.radiosity.patch_irradiance import PatchLight
from relume.raytrace.gather_rays import make_pattern

NUM_CELLS, POINTS, RAYS = 6, 4, 5
LEAN = 0.6, -0.2, 0.77  # of a texel, about


class Traced:
    """A `RayTracer` that says what it was asked for."""

    def check(self):
        """Nothing lacks."""

    def visibility(self, points, before, bits):
        self.points, self.before, self.known = points, before, bits
        return np.full_like(bits, 7)

    def gather_hits(self, points, wo, pattern):
        assert wo is points.normal
        return np.full((points.num_points, pattern.num_rays), 9, np.uint16)


@pytest.fixture(scope="module")
def named(tmp_path_factory):
    folder = tmp_path_factory.mktemp("normals")
    texel = np.round(127.5 * (np.array(LEAN) / np.linalg.norm(LEAN) + 1)).astype(np.uint8)
    Image.fromarray(np.broadcast_to(texel, (2, 2, 3)).copy()).save(folder / "slope.png")
    with IMAGES.with_search_folder(folder / "images") as library:
        yield store(library, folder / "slope.png", "Slope").texture


@pytest.fixture
def cells():
    """Of two materials in turn, on a floor; u runs along x, and v along z."""
    rng = np.random.default_rng(1)
    normal = np.broadcast_to(np.float32([0, 1, 0]), (NUM_CELLS, POINTS, 3)).copy()
    points = patch_sample_points(rng.random((NUM_CELLS, POINTS, 3), np.float32), normal)
    across = np.cross(points.normal, points.tangent)
    turn = np.arctan2(across[:, 0], points.tangent[:, 0]).reshape(NUM_CELLS, POINTS, 1)
    uv = np.concatenate([rng.random((NUM_CELLS, POINTS, 2)), 0 * turn, turn, 0 * turn + 1], axis=2)
    bits = rng.integers(0, 256, (NUM_CELLS, POINTS, 3)).astype(np.uint8)
    links = rng.integers(0, NUM_CELLS, (NUM_CELLS, POINTS * RAYS)).astype(np.uint16)
    material, white = (np.arange(NUM_CELLS) % 2).astype(np.uint16), np.ones((2, NUM_CELLS, 3), np.float32)
    pattern = make_pattern(RAYS, 0, 9)
    return PatchLight(points, bits, links, pattern, material, white, uv.astype(np.float32), normal)


def test_they_lean_as_their_texels_do(cells, named):
    """Green leans up the image, against v."""
    mapped = normal_mapped_patches(cells, (None, NormalMap(named)), Traced())
    normal = mapped.points.normal.reshape(NUM_CELLS, POINTS, 3)
    x, y, z = np.array(LEAN) / np.linalg.norm(LEAN)
    np.testing.assert_allclose(normal[1::2], np.broadcast_to([x, z, -y], normal[1::2].shape), atol=0.01)
    np.testing.assert_array_equal(normal[::2], cells.points.normal.reshape(normal.shape)[::2])
    np.testing.assert_allclose(np.einsum("nc,nc->n", mapped.points.normal, mapped.points.tangent), 0, atol=1e-6)


def test_their_rays_are_traced_and_no_others(cells, named):
    traced = Traced()
    mapped = normal_mapped_patches(cells, (None, NormalMap(named)), traced)
    assert (mapped.visible[1::2] == 7).all()
    assert (mapped.gather_hits[1::2] == 9).all()
    np.testing.assert_array_equal(mapped.visible[::2], cells.visible[::2])
    np.testing.assert_array_equal(mapped.gather_hits[::2], cells.gather_hits[::2])
    np.testing.assert_array_equal(traced.known, cells.visible[1::2].reshape(-1, 3))
    np.testing.assert_array_equal(traced.before, np.broadcast_to(np.float32([0, 1, 0]), traced.before.shape))
    seeds = cells.points.seed.reshape(NUM_CELLS, POINTS)
    np.testing.assert_array_equal(traced.points.seed, seeds[1::2].ravel())  # which shift the pattern of their rays


def test_frames_are_those_of_the_normals(cells, named):
    """What they send is turned with them, whatever was known of the others."""
    assert np.allclose(cells.frames[:, 0] @ [0, 1, 0], 0, atol=1e-6)
    mapped = normal_mapped_patches(cells, (None, NormalMap(named)), Traced())
    mean = mapped.points.normal.reshape(NUM_CELLS, POINTS, 3).mean(axis=1)
    np.testing.assert_allclose(np.einsum("gfc,gc->gf", mapped.frames, mean), 0, atol=1e-5)


@pytest.mark.parametrize("missing", ["uv", "surface_normal"])
def test_those_of_bakes_that_do_not_say_how_textures_lie_stay(cells, named, missing):
    older = replace(cells, **{missing: None})
    assert normal_mapped_patches(older, (NormalMap(named), None), Traced()) is older


def test_who_does_not_want_them_any_more_gets_none(cells, named):
    with pytest.raises(CancelledError):
        normal_mapped_patches(cells, (None, NormalMap(named)), Traced(), lambda: True)


def test_images_on_what_has_no_cells_trace_nothing(cells, named):
    assert normal_mapped_patches(cells, (None, None, NormalMap(named)), None) is cells
