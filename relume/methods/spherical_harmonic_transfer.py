"""Spherical-harmonic transfer in a store: low-frequency light at probes and patches (`relume.transport.sh_transfer`).

    sh/basis, cluster, weight            of probes: ClusteredTransfer
    sh/irradiance, coefficients          of patches: (C, NUM_HARMONICS), and of their first points (C, K, NUM_HARMONICS)

Computed once per bake; used while an environment is rotated or exchanged.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import ChunkDamagedError
from relume.lights.frequency_split import FrequencySplit, split_frequencies
from relume.lights.spherical_triangles import TriangleLights
from relume.live.free_camera.probes.stored_scene import read_probes
from relume.math.spherical_harmonics import NUM_HARMONICS, harmonics
from relume.math.zernike import FAST_DEGREE, num_functions
from relume.methods.read_cache import ReadCache
from relume.methods.store_layout import read_patches, read_shadow_ray_directions, read_tiles
from relume.radiosity.patch_irradiance import PatchLight
from relume.store.bake_protocol import StoreReader
from relume.transport.sh_transfer import NUM_CLUSTERS, NUM_COMPONENTS, ClusteredTransfer, transfer_matrices

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

PATCH_DEGREE = 2  # light of patches is averaged over many directions, which leaves little above this degree


@dataclass(frozen=True)
class HarmonicLight:
    """Spherical-harmonic transfer to the probes and patches of a bake.

    Attributes:
        probe_transfer: in the Zernike basis of `FAST_DEGREE`.
        irradiance: irradiance of patches.
        patch_coefficients: patch coefficients of their first points, of `PATCH_DEGREE`.
        light_coefficients: weights of the bake's lights for each harmonic.
    """

    probe_transfer: ClusteredTransfer
    irradiance: Shaped[F32, "patches harmonics"]
    patch_coefficients: Shaped[F32, "patches K harmonics"]
    light_coefficients: Shaped[F64, "M harmonics"]

    @cached_property
    def frequency_split(self) -> ReadCache[TriangleLights, FrequencySplit]:
        """Split lights into spherical harmonics and the residual; cached, as callers need it three times."""
        return ReadCache(lambda lights: split_frequencies(lights, self.light_coefficients))


def make_harmonic_light(store: StoreReader, seed: int) -> dict[str, NDArray[Any]]:
    """Compute the arrays of a store for `read_harmonic_light`. seed: seed of the clusters."""
    light_samples = read_shadow_ray_directions(store), read_tiles(store).solid_angles
    probes, visible, patches = read_probes(store), store.read("probes/visibility"), read_patches(store)

    def matrices(rows: NDArray[np.intp]) -> F32:
        return transfer_matrices(probes.rows(rows), visible[rows], *light_samples, FAST_DEGREE)

    clustered = ClusteredTransfer.fit(probes.num_points, matrices, np.random.default_rng(seed))
    point_transfer = transfer_matrices(
        patches.points, patches.visible.reshape(patches.points.num_points, patches.visible.shape[2]), *light_samples, 0
    )
    irradiance = np.sqrt(np.pi) * point_transfer.reshape(
        patches.num_patches, patches.points_per_patch, NUM_HARMONICS
    ).mean(axis=1)
    patch_rows = np.arange(patches.num_patches)
    first_visible = np.ascontiguousarray(patches.visible[:, 0])
    patch_coefficients = transfer_matrices(
        patches.first_points(patch_rows), first_visible, *light_samples, PATCH_DEGREE
    )
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


def read_harmonic_light(store: StoreReader, patches: PatchLight) -> HarmonicLight | None:
    """Read the transfer; None if a store has none, such as those of fixed views and of earlier versions.

    Raises:
        ChunkDamagedError: the arrays do not match.
    """
    if not store.attributes.get("has_sh"):
        return None
    probe_transfer = ClusteredTransfer(*(store.read(f"sh/{name}") for name in ClusteredTransfer._fields))
    irradiance, patch_coefficients = (
        store.read(f"sh/{name}").astype(np.float32) for name in ("irradiance", "coefficients")
    )
    shape = num_functions(FAST_DEGREE), NUM_HARMONICS
    fits = len(probe_transfer.cluster) == len(probe_transfer.weight) == store.shape("probes/material")[0]
    fits = fits and probe_transfer.basis.shape[1:] == (1 + probe_transfer.weight.shape[1], *shape)
    fits = fits and int(probe_transfer.cluster.max(initial=0)) < len(probe_transfer.basis)
    patch_shape = patches.num_patches, num_functions(PATCH_DEGREE), NUM_HARMONICS
    if not (fits and irradiance.shape == patch_shape[::2] and patch_coefficients.shape == patch_shape):
        raise ChunkDamagedError("sh", "its arrays do not match the probes and patches")
    light_coefficients = (
        harmonics(read_shadow_ray_directions(store).astype(np.float64)) * read_tiles(store).solid_angles[:, None]
    )
    return HarmonicLight(probe_transfer, irradiance, patch_coefficients, light_coefficients)
