"""What places of a BTF send, by kernels against plain NumPy."""

import numpy as np
import pytest
from btf_reference import outgoing_radiance_numpy, sample_btf_numpy

from relume.assets.btf.btf_store import load_btf
from relume.assets.btf.outgoing_radiance import outgoing_radiance, sample_btf


@pytest.mark.parametrize("components", [0, 3, 16])
def test_kernels_do_as_their_oracles(small_btf, components):
    found, rng = load_btf(small_btf.record.data).with_components(components), np.random.default_rng(4)
    wo = rng.normal(size=(40, 3))
    wo[:, 2] = np.abs(wo[:, 2]) * rng.uniform(0.02, 1, 40)  # some near the horizon, beyond the last ring
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    wo[0] = 0, 0, 1
    places = rng.uniform(-40, 40, (40, 3, 2))
    all_seen = sample_btf(found, found.tables(), places, wo)
    expected = np.stack([sample_btf_numpy(found, some, eye) for some, eye in zip(places, wo, strict=True)])
    np.testing.assert_allclose(all_seen, expected, atol=3e-6 * expected.max())
    axes, of = np.array([[[0.6, 0.8], [-0.8, 0.6]], [[0.0, 1.0], [1.0, 0.0]]]), np.arange(40) % 2
    turned = np.column_stack([np.einsum("nij,nj->ni", axes[of], wo[:, :2]), wo[:, 2]])
    each = [outgoing_radiance_numpy(found, expected[p], one[None])[0] for p, one in zip(of, turned, strict=True)]
    np.testing.assert_allclose(outgoing_radiance(found, all_seen[:2], axes, of, wo), each, atol=3e-6 * expected.max())
