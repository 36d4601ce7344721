"""Outgoing radiance of BTF texels: kernels against plain NumPy."""

import numpy as np
import pytest
from btf_reference import outgoing_radiance_numpy, sample_btf_numpy

from relume.assets.btf.btf_store import load_btf
from relume.assets.btf.outgoing_radiance import outgoing_radiance, sample_btf


@pytest.mark.parametrize("components", [0, 3, 16])
def test_kernels_equal_their_references(small_btf, components):
    btf, rng = load_btf(small_btf.record.data).with_components(components), np.random.default_rng(4)
    wo = rng.normal(size=(40, 3))
    wo[:, 2] = np.abs(wo[:, 2]) * rng.uniform(0.02, 1, 40)  # some near the horizon, beyond the last ring
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    wo[0] = 0, 0, 1
    positions = rng.uniform(-40, 40, (40, 3, 2))
    values_by_light = sample_btf(btf, btf.tables(), positions, wo)
    expected = np.stack([sample_btf_numpy(btf, some, direction) for some, direction in zip(positions, wo, strict=True)])
    np.testing.assert_allclose(values_by_light, expected, atol=3e-6 * expected.max())
    axes, texel = np.array([[[0.6, 0.8], [-0.8, 0.6]], [[0.0, 1.0], [1.0, 0.0]]]), np.arange(40) % 2
    rotated = np.column_stack([np.einsum("nij,nj->ni", axes[texel], wo[:, :2]), wo[:, 2]])
    reference = [outgoing_radiance_numpy(btf, expected[p], wi[None])[0] for p, wi in zip(texel, rotated, strict=True)]
    np.testing.assert_allclose(
        outgoing_radiance(btf, values_by_light[:2], axes, texel, wo), reference, atol=3e-6 * expected.max()
    )
