"""Local PCA: what it keeps is what was there, to the error it says, in as little as it says."""

import numpy as np
import pytest

from relume.assets.btf.compress import MAX_COMPONENTS, compress, max_texels
from relume.assets.btf.direction_rings import directions, make_direction_grid, ubo_grid
from relume.assets.btf.partial_results import PartialCompression
from relume.core.errors import CancelledError, MaterialError

RINGS = ubo_grid()


class Facets:
    """Texels of few kinds, each a Lambertian facet that leans; `kinds` different ones."""

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
        seen = np.maximum(self._normals[self._kind] @ directions(RINGS)[view], 0.1)
        return ((lit * seen[:, None]).T[..., None] * self._gain).astype(np.float32)


def kept(images, bound=0.01, progress=lambda share: None, is_canceled=lambda: False, begun=None):
    return compress(images, bound, progress, is_canceled, begun)


def whole(images):
    return np.stack([images.get_view(v) for v in range(81)]).transpose(2, 0, 1, 3).astype(np.float64)


def test_the_error_it_says_is_that_of_what_it_kept():
    images = Facets(kinds=9)
    found, truth = kept(images), whole(images)
    told = np.stack([found.texel_brdf(k) for k in range(len(truth))])
    error = np.linalg.norm(told - truth) / np.linalg.norm(truth)
    assert found.error[-1] == pytest.approx(error, rel=1e-3)
    assert error <= 0.015  # the bound, and rounding to 256 steps
    fewer = found.with_components(1)
    one = np.stack([fewer.texel_brdf(k) for k in range(len(truth))])
    assert found.error[1] == pytest.approx(np.linalg.norm(one - truth) / np.linalg.norm(truth), rel=1e-3)
    assert list(found.error) == sorted(found.error, reverse=True)


def test_a_looser_bound_keeps_less():
    images = Facets(kinds=30)
    tight, loose = kept(images, 0.01), kept(images, 0.2)
    assert loose.num_bytes < tight.num_bytes
    assert loose.bits.max() < tight.bits.max()
    assert list(loose.bits) == sorted(loose.bits, reverse=True)  # the strongest components have the finest steps
    for found in (loose, tight):
        assert (np.abs(found.weight).max(axis=(0, 1)) == 2 ** (found.bits.astype(int) - 1) - 1).all()
    assert loose.error[-1] <= 0.21
    assert tight.num_components <= MAX_COMPONENTS


def test_the_average_is_the_mean_of_all_texels_and_coarser_levels_are_means():
    images = Facets(kinds=6, size=(8, 8))
    found, truth = kept(images, 0.001), whole(images)
    np.testing.assert_allclose(found.average, truth.mean(axis=0), atol=2e-3)
    assert found.levels.tolist() == [[0, 8, 8], [64, 4, 4], [80, 2, 2], [84, 1, 1]]
    of_four = truth.reshape(4, 2, 4, 2, 81, 81, 3).mean(axis=(1, 3)).reshape(16, 81, 81, 3)
    coarser = np.stack([found.texel_brdf(64 + k) for k in range(16)])
    assert np.linalg.norm(coarser - of_four) < 0.06 * np.linalg.norm(of_four)


def test_progress_rises_to_the_end_and_a_cancelled_one_stops():
    shares = []
    kept(Facets(kinds=3), progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] > 0.9
    with pytest.raises(CancelledError):
        kept(Facets(kinds=3), is_canceled=lambda: len(shares) > 0)


def counted(images):
    """Count how often each view is read, in a list that is returned."""
    read, seen_from = [], images.get_view
    images.get_view = lambda view: read.append(view) or seen_from(view)
    return read


def test_one_that_was_stopped_goes_on_and_finds_the_same(tmp_path):
    images, asked = Facets(kinds=9), []
    expected = kept(images)
    with pytest.raises(CancelledError):
        kept(
            images,
            is_canceled=lambda: asked.append(0) or len(asked) > 40,
            begun=PartialCompression(tmp_path / "a", {"bound": 0.01}),
        )
    (tmp_path / "a" / "view-3.npz").write_bytes(b"PK\x03\x04 half written")
    read = counted(images)
    found = kept(images, begun=PartialCompression(tmp_path / "a", {"bound": 0.01}))
    assert read == [3, *range(35, 81)]  # five were read to choose by, then 35
    for name in ("cluster", "weight", "bits", "mean", "eigen", "step", "average", "error"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    read.clear()
    kept(images, 0.2, begun=PartialCompression(tmp_path / "a", {"bound": 0.2}))
    assert len(read) == 5 + 81  # what was found for another bound does not count


@pytest.mark.parametrize(("value", "said"), [(np.nan, "non-finite"), (-1.0, "negative"), (np.inf, "non-finite")])
def test_values_that_are_none_are_refused(value, said):
    images = Facets(kinds=3)
    good = images.get_view

    def bad(view):
        values = good(view)
        if view == 40:
            values[3, 5, 1] = value
        return values

    images.get_view = bad
    with pytest.raises(MaterialError, match=said):
        kept(images)


def test_one_side_may_be_black():
    images = Facets(kinds=3)
    good = images.get_view
    images.get_view = lambda view: good(view) * (view != 0)
    found = kept(images)
    assert found.error[-1] < 0.015
    assert not found.texel_brdf(7)[0].any()


def test_what_is_no_smaller_is_not_kept_however_near():
    """Noise has no components: a bound that cannot be met does not keep all of it."""
    images, rng = Facets(kinds=3, size=(16, 16)), np.random.default_rng(3)
    noise = rng.uniform(size=(81, 256, 3)).astype(np.float32)
    images.get_view = lambda view: noise
    found = kept(images, 0.001)
    assert found.num_bytes * 2.4 < found.measured_bytes
    assert found.error[-1] > 0.1


def test_a_black_btf_and_one_that_is_too_large_are_refused():
    images = Facets(kinds=3)
    images.get_view = lambda view: np.zeros((81, 120, 3), np.float32)
    with pytest.raises(MaterialError, match="black"):
        kept(images)
    images.size = (1 << 20, 1 << 20)
    with pytest.raises(MaterialError, match="texels"):
        kept(images)


def test_more_texels_than_memory_is_meant_for_are_refused_before_any_is_read():
    class Large:
        # 81 directions may have as many
        grid, size = make_direction_grid([(0.0, 1), (40.0, 199), (70.0, 200)]), (300, 300)

    assert max_texels(81) > 300 * 300
    with pytest.raises(MaterialError, match="the limit for 400 directions is 83,886; scale it down"):
        kept(Large())
