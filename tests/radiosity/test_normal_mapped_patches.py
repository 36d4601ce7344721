"""Patches under a normal map: their normals follow the texels, and their rays are traced about the new normals."""

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

NUM_PATCHES, POINTS, RAYS = 6, 4, 5
TILTED_NORMAL = 0.6, -0.2, 0.77  # approximate normal of a texel


class Traced:
    """A `RayTracer` that records its calls."""

    def check(self):
        """Nothing is missing."""

    def visibility(self, points, before, bits):
        self.points, self.before, self.known = points, before, bits
        return np.full_like(bits, 7)

    def gather_hits(self, points, wo, pattern):
        assert wo is points.normal
        return np.full((points.num_points, pattern.num_rays), 9, np.uint16)


@pytest.fixture(scope="module")
def named(tmp_path_factory):
    folder = tmp_path_factory.mktemp("normals")
    texel = np.round(127.5 * (np.array(TILTED_NORMAL) / np.linalg.norm(TILTED_NORMAL) + 1)).astype(np.uint8)
    Image.fromarray(np.broadcast_to(texel, (2, 2, 3)).copy()).save(folder / "slope.png")
    with IMAGES.with_search_folder(folder / "images") as library:
        yield store(library, folder / "slope.png", "Slope").texture


@pytest.fixture
def patches():
    """Patches with alternating materials on a floor; u runs along x, and v along z."""
    rng = np.random.default_rng(1)
    normal = np.broadcast_to(np.float32([0, 1, 0]), (NUM_PATCHES, POINTS, 3)).copy()
    points = patch_sample_points(rng.random((NUM_PATCHES, POINTS, 3), np.float32), normal)
    across = np.cross(points.normal, points.tangent)
    turn = np.arctan2(across[:, 0], points.tangent[:, 0]).reshape(NUM_PATCHES, POINTS, 1)
    uv = np.concatenate([rng.random((NUM_PATCHES, POINTS, 2)), 0 * turn, turn, 0 * turn + 1], axis=2)
    bits = rng.integers(0, 256, (NUM_PATCHES, POINTS, 3)).astype(np.uint8)
    hits = rng.integers(0, NUM_PATCHES, (NUM_PATCHES, POINTS * RAYS)).astype(np.uint16)
    material, white = (np.arange(NUM_PATCHES) % 2).astype(np.uint16), np.ones((2, NUM_PATCHES, 3), np.float32)
    pattern = make_pattern(RAYS, 0, 9)
    return PatchLight(points, bits, hits, pattern, material, white, uv.astype(np.float32), normal)


def test_patch_normals_follow_their_texels(patches, named):
    """Green tilts up the image, against v."""
    mapped = normal_mapped_patches(patches, (None, NormalMap(named)), Traced())
    normal = mapped.points.normal.reshape(NUM_PATCHES, POINTS, 3)
    x, y, z = np.array(TILTED_NORMAL) / np.linalg.norm(TILTED_NORMAL)
    np.testing.assert_allclose(normal[1::2], np.broadcast_to([x, z, -y], normal[1::2].shape), atol=0.01)
    np.testing.assert_array_equal(normal[::2], patches.points.normal.reshape(normal.shape)[::2])
    np.testing.assert_allclose(np.einsum("nc,nc->n", mapped.points.normal, mapped.points.tangent), 0, atol=1e-6)


def test_only_normal_mapped_patches_are_traced(patches, named):
    traced = Traced()
    mapped = normal_mapped_patches(patches, (None, NormalMap(named)), traced)
    assert (mapped.visible[1::2] == 7).all()
    assert (mapped.gather_hits[1::2] == 9).all()
    np.testing.assert_array_equal(mapped.visible[::2], patches.visible[::2])
    np.testing.assert_array_equal(mapped.gather_hits[::2], patches.gather_hits[::2])
    np.testing.assert_array_equal(traced.known, patches.visible[1::2].reshape(-1, 3))
    np.testing.assert_array_equal(traced.before, np.broadcast_to(np.float32([0, 1, 0]), traced.before.shape))
    seeds = patches.points.seed.reshape(NUM_PATCHES, POINTS)
    np.testing.assert_array_equal(traced.points.seed, seeds[1::2].ravel())  # seeds shift the pattern of rays


def test_frames_follow_the_mapped_normals(patches, named):
    """Outgoing light is rotated with them, whatever is stored for the others."""
    assert np.allclose(patches.frames[:, 0] @ [0, 1, 0], 0, atol=1e-6)
    mapped = normal_mapped_patches(patches, (None, NormalMap(named)), Traced())
    mean = mapped.points.normal.reshape(NUM_PATCHES, POINTS, 3).mean(axis=1)
    np.testing.assert_allclose(np.einsum("gfc,gc->gf", mapped.frames, mean), 0, atol=1e-5)


@pytest.mark.parametrize("missing", ["uv", "surface_normal"])
def test_patches_of_bakes_without_tangents_are_unchanged(patches, named, missing):
    older = replace(patches, **{missing: None})
    assert normal_mapped_patches(older, (NormalMap(named), None), Traced()) is older


def test_tracing_can_be_cancelled(patches, named):
    with pytest.raises(CancelledError):
        normal_mapped_patches(patches, (None, NormalMap(named)), Traced(), lambda: True)


def test_maps_on_materials_without_patches_trace_nothing(patches, named):
    assert normal_mapped_patches(patches, (None, None, NormalMap(named)), None) is patches
