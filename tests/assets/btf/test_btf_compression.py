"""Local PCA: it represents the original values within the error and the size that it reports."""

import numpy as np
import pytest

from relume.assets.btf.compress import FLAT, Coders, compress, max_texels
from relume.assets.btf.direction_rings import directions, make_direction_grid, ubo_grid
from relume.assets.btf.parallax import compute_shears, visible_texels
from relume.assets.btf.partial_results import PartialCompression
from relume.assets.btf.per_view_coder import MAX_COMPONENTS
from relume.assets.btf.stored_arrays import from_arrays, stored_bytes, to_arrays
from relume.core.errors import CancelledError, MaterialError

RINGS = ubo_grid()


class Facets:
    """Lambertian facets whose normals are tilted; `kinds` different ones over the texels."""

    grid = RINGS

    def __init__(self, kinds, size=(12, 10), seed=2):
        rng = np.random.default_rng(seed)
        self.size = size
        normals = rng.normal(size=(kinds, 3)) * 0.3 + [0, 0, 1]
        self._normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        self._kind = rng.integers(0, kinds, size[0] * size[1])
        self._gain = rng.uniform(0.2, 1, (size[0] * size[1], 3))

    def get_view(self, view):
        lit = np.maximum(self._normals[self._kind] @ directions(RINGS).T, 0)
        cosines = np.maximum(self._normals[self._kind] @ directions(RINGS)[view], 0.1)
        return ((lit * cosines[:, None]).T[..., None] * self._gain).astype(np.float32)


def compressed(images, bound=0.01, progress=lambda fraction: None, is_canceled=lambda: False, begun=None, height=FLAT):
    return compress(images, bound, progress, is_canceled, begun, height)


def all_values(images):
    return np.stack([images.get_view(v) for v in range(81)]).transpose(2, 0, 1, 3).astype(np.float64)


def test_the_reported_error_is_the_error_of_the_stored_values():
    images = Facets(kinds=9)
    btf, original = compressed(images), all_values(images)
    decoded = np.stack([btf.texel_brdf(k) for k in range(len(original))])
    error = np.linalg.norm(decoded - original) / np.linalg.norm(original)
    assert btf.error[-1] == pytest.approx(error, rel=1e-3)
    assert error <= 0.015  # the bound, and rounding to 256 steps
    fewer = btf.with_components(1)
    coarse = np.stack([fewer.texel_brdf(k) for k in range(len(original))])
    assert btf.error[1] == pytest.approx(np.linalg.norm(coarse - original) / np.linalg.norm(original), rel=1e-3)
    assert list(btf.error) == sorted(btf.error, reverse=True)


def test_a_looser_bound_takes_less_memory():
    images = Facets(kinds=30)
    tight, loose = compressed(images, 0.01), compressed(images, 0.2)
    assert stored_bytes(loose) < stored_bytes(tight)
    assert loose.error[-1] <= 0.21
    assert tight.num_components <= MAX_COMPONENTS


def test_the_average_is_the_mean_of_all_texels_and_coarser_levels_are_means():
    images = Facets(kinds=6, size=(8, 8))
    btf, original = compressed(images, 0.001), all_values(images)
    np.testing.assert_allclose(btf.average, original.mean(axis=0), atol=2e-3)
    assert btf.levels.tolist() == [[0, 8, 8], [64, 4, 4], [80, 2, 2], [84, 1, 1]]
    of_four = original.reshape(4, 2, 4, 2, 81, 81, 3).mean(axis=(1, 3)).reshape(16, 81, 81, 3)
    coarser = np.stack([btf.texel_brdf(64 + k) for k in range(16)])
    assert np.linalg.norm(coarser - of_four) < 0.06 * np.linalg.norm(of_four)


def test_progress_rises_to_the_end_and_a_cancelled_one_stops():
    fractions = []
    compressed(Facets(kinds=3), progress=fractions.append)
    assert fractions == sorted(fractions)
    assert fractions[-1] > 0.9
    with pytest.raises(CancelledError):
        compressed(Facets(kinds=3), is_canceled=lambda: len(fractions) > 0)


def counted(images):
    """Record each view that is read in the returned list."""
    read, get_view = [], images.get_view
    images.get_view = lambda view: read.append(view) or get_view(view)
    return read


@pytest.mark.slow
def test_a_resumed_compression_gives_the_same_result(tmp_path):
    images, polled = Facets(kinds=9), []
    expected = compressed(images)
    with pytest.raises(CancelledError):
        compressed(
            images,
            is_canceled=lambda: polled.append(0) or len(polled) > 80,
            begun=PartialCompression(tmp_path / "a", {"bound": 0.01}),
        )
    complete = {int(path.stem.split("-")[1]) for path in (tmp_path / "a").glob("view-*.npz")} - {3}
    assert 5 < len(complete) < 80
    (tmp_path / "a" / "view-3-0.01.npz").write_bytes(b"PK\x03\x04 half written")
    read = counted(images)
    btf = compressed(images, begun=PartialCompression(tmp_path / "a", {"bound": 0.01}))
    left = [view for view in range(81) if view not in complete]
    assert read[: len(left)] == left  # the views that select components are not read again
    assert read[len(left) :] in ([], list(range(81)))  # whole BRDFs
    for name in ("cluster", "weight", "mean", "mean_step", "eigen", "step", "average", "error"):
        np.testing.assert_array_equal(getattr(btf, name), getattr(expected, name))
    read.clear()
    compressed(images, 0.2, begun=PartialCompression(tmp_path / "a", {"bound": 0.2}))
    assert len(read) >= 5 + 81  # results for another bound are not reused


@pytest.mark.parametrize(("value", "message"), [(np.nan, "non-finite"), (-1.0, "negative"), (np.inf, "non-finite")])
def test_invalid_values_are_rejected(value, message):
    images = Facets(kinds=3)
    good = images.get_view

    def bad(view):
        values = good(view)
        if view == 40:
            values[3, 5, 1] = value
        return values

    images.get_view = bad
    with pytest.raises(MaterialError, match=message):
        compressed(images)


def test_one_half_may_be_black():
    images = Facets(kinds=3)
    good = images.get_view
    images.get_view = lambda view: good(view) * (view != 0)
    btf = compressed(images)
    assert btf.error[-1] < 0.015
    assert not btf.texel_brdf(7)[0].any()


def test_compression_that_saves_no_memory_is_rejected():
    """Noise has no principal components: an unreachable bound does not store all of them."""
    images, rng = Facets(kinds=3, size=(16, 16)), np.random.default_rng(3)
    noise = rng.uniform(size=(81, 256, 3)).astype(np.float32)
    images.get_view = lambda view: noise
    btf = compressed(images, 0.001)
    assert stored_bytes(btf) * 2.4 < btf.measured_bytes
    assert btf.error[-1] > 0.1


def test_a_black_btf_and_one_that_is_too_large_are_rejected():
    images = Facets(kinds=3)
    images.get_view = lambda view: np.zeros((81, 120, 3), np.float32)
    with pytest.raises(MaterialError, match="black"):
        compressed(images)
    images.size = (1 << 20, 1 << 20)
    with pytest.raises(MaterialError, match="texels"):
        compressed(images)


def test_too_many_texels_for_the_memory_limit_are_rejected_before_reading():
    class Large:
        # the limit for 81 directions
        grid, size = make_direction_grid([(0.0, 1), (40.0, 199), (70.0, 200)]), (300, 300)

    assert max_texels(81) > 300 * 300
    with pytest.raises(MaterialError, match="the limit for 400 directions is 83,886; scale it down"):
        compressed(Large())


class Reliefs(Facets):
    """Facets on waves: each view shows the texels that its rays meet."""

    def __init__(self, height):
        super().__init__(kinds=5, size=height.shape)
        self.height, self._source = height, visible_texels(height, RINGS, height.shape)

    def get_view(self, view):
        return super().get_view(view)[:, self._source[view]]


def waves(size=24):
    v, u = np.meshgrid(*[(np.arange(size) + 0.5) / size] * 2, indexing="ij")
    return (0.1 * np.sin(2 * np.pi * u) * np.cos(2 * np.pi * v)).astype(np.float32)


def both_coders(images, height, folder):
    return Coders(images, height, lambda fraction: None, lambda: False, PartialCompression(folder, {}))


@pytest.mark.parametrize("coder", ["per_view", "whole_brdfs"])
def test_each_coder_reports_the_error_of_what_it_stores(coder, tmp_path):
    images = Reliefs(waves(12))
    btf, original = getattr(both_coders(images, images.height, tmp_path), coder)(0.03), all_values(images)
    stored = from_arrays(to_arrays(btf), RINGS, btf.error)
    decoded = np.stack([stored.texel_brdf(texel) for texel in range(len(original))])
    error = np.linalg.norm(decoded - original) / np.linalg.norm(original)
    assert btf.error[-1] == pytest.approx(error, rel=1e-3)
    assert error <= 0.035
    for name in ("levels", "cluster", "weight", "mean", "mean_step", "eigen", "step", "average", "height"):
        np.testing.assert_array_equal(getattr(stored, name), getattr(btf, name))
    fewer = btf.with_components(1)
    assert stored_bytes(fewer) < stored_bytes(btf)
    loaded = from_arrays(to_arrays(fewer), RINGS, fewer.error)
    np.testing.assert_array_equal(loaded.weight, fewer.weight)


@pytest.mark.slow
def test_the_smaller_of_both_coders_is_taken():
    """Whole BRDFs for a plane; clusters per view if texels of different views have nothing in common."""
    flat = Facets(kinds=9, size=(24, 24))
    btf = compressed(flat, 0.03)
    assert btf.shared is not None
    assert btf.error[-1] <= 0.03

    class Unrelated(Facets):
        def get_view(self, view):
            return super().get_view(view)[:, np.random.default_rng(view).permutation(self.size[0] * self.size[1])]

    other = compressed(Unrelated(kinds=9, size=(24, 24)), 0.1)
    assert other.shared is None
    assert other.error[-1] <= 0.11


def test_whole_brdfs_follow_the_relief_by_its_height(tmp_path):
    images = Reliefs(waves())
    assert (compute_shears(RINGS)[80] * np.ptp(images.height) * 24).max() > 3  # texels of parallax
    with_height = both_coders(images, images.height, tmp_path / "a").whole_brdfs(0.03)
    assert with_height.error[-1] <= 0.03
    without = both_coders(images, FLAT, tmp_path / "b").whole_brdfs(0.03)
    assert without is None or stored_bytes(without) > 2 * stored_bytes(with_height)
