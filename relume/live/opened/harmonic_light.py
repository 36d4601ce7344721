"""Low-frequency light of probes and patches, by the spherical-harmonic transfer of a store.

Used while an environment is rotated or exchanged; `relume.methods.spherical_harmonic_transfer` bakes it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import ChunkDamagedError
from relume.lights.frequency_split import FrequencySplit, split_frequencies
from relume.lights.spherical_triangles import TriangleLights
from relume.math.spherical_harmonics import NUM_HARMONICS, harmonics
from relume.math.zernike import FAST_DEGREE, num_functions
from relume.methods.read_cache import ReadCache
from relume.methods.spherical_harmonic_transfer import PATCH_DEGREE
from relume.methods.store_layout import read_shadow_ray_directions, read_tiles
from relume.radiosity.patch_irradiance import PatchLight
from relume.store.bake_protocol import StoreReader
from relume.transport.sh_transfer import ClusteredTransfer

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@dataclass(frozen=True)
class HarmonicLight:
    """Spherical-harmonic transfer to the probes and patches of a bake.

    Attributes:
        probe_transfer: in the Zernike basis of `FAST_DEGREE`.
        irradiance: of patches.
        patch_coefficients: of their first points, of `PATCH_DEGREE`.
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
