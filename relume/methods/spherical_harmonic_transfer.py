"""Spherical-harmonic transfer in a store: low-frequency light at probes and patches (`relume.transport.sh_transfer`).

    sh/basis, cluster, weight            of probes: ClusteredTransfer
    sh/irradiance, coefficients          of patches: (C, NUM_HARMONICS), and of their first points (C, K, NUM_HARMONICS)

Computed once per bake; used while an environment is rotated or exchanged (`relume.live.opened.harmonic_light`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.math.spherical_harmonics import NUM_HARMONICS
from relume.math.zernike import FAST_DEGREE, num_functions
from relume.methods.patch_layout import read_patch_points
from relume.methods.store_layout import read_shadow_ray_directions, read_tiles
from relume.probes.stored_scene import read_probes
from relume.store.bake_protocol import StoreReader
from relume.transport.sh_transfer import NUM_CLUSTERS, NUM_COMPONENTS, ClusteredTransfer, transfer_matrices

F32 = NDArray[np.float32]

PATCH_DEGREE = 2  # light of patches is averaged over many directions, which leaves little above this degree


def make_harmonic_light(store: StoreReader, seed: int) -> dict[str, NDArray[Any]]:
    """Compute the arrays of a store for `read_harmonic_light`. seed: seed of the clusters."""
    light_samples = read_shadow_ray_directions(store), read_tiles(store).solid_angles
    probes, visible = read_probes(store), store.read("probes/visibility")
    patch_points, (num_patches, points_per_patch, _) = read_patch_points(store), store.shape("patches/normal")
    num_bytes = (len(light_samples[0]) + 7) // 8  # stated, because a scene may have no patches
    patch_visible = store.read("patches/visibility").reshape(num_patches, points_per_patch, num_bytes)

    def matrices(rows: NDArray[np.intp]) -> F32:
        return transfer_matrices(probes.rows(rows), visible[rows], *light_samples, FAST_DEGREE)

    clustered = ClusteredTransfer.fit(probes.num_points, matrices, np.random.default_rng(seed))
    point_transfer = transfer_matrices(
        patch_points, patch_visible.reshape(patch_points.num_points, num_bytes), *light_samples, 0
    )
    irradiance = np.sqrt(np.pi) * point_transfer.reshape(num_patches, points_per_patch, NUM_HARMONICS).mean(axis=1)
    first_points = patch_points.rows(np.arange(num_patches) * points_per_patch)
    first_visible = np.ascontiguousarray(patch_visible[:, 0])
    patch_coefficients = transfer_matrices(first_points, first_visible, *light_samples, PATCH_DEGREE)
    return {
        **{f"sh/{name}": array for name, array in clustered._asdict().items()},
        "sh/irradiance": irradiance.astype(np.float16),
        "sh/coefficients": patch_coefficients.astype(np.float16),
    }


def harmonic_bytes(num_probes: int, num_patches: int) -> int:
    """Upper bound of its bytes in a store."""
    basis_bytes = 2 * NUM_CLUSTERS * (1 + NUM_COMPONENTS) * num_functions(FAST_DEGREE) * NUM_HARMONICS
    probe_bytes = num_probes * (1 + 2 * NUM_COMPONENTS)
    return basis_bytes + probe_bytes + 2 * num_patches * (1 + num_functions(PATCH_DEGREE)) * NUM_HARMONICS
