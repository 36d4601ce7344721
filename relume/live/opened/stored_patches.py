"""The patches of a store, with all that their light in a look takes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.brdf.texture_slots import TEXTURES
from relume.methods.patch_layout import read_patch_points
from relume.radiosity.patch_irradiance import PatchLight
from relume.raytrace.gather_rays import make_pattern
from relume.store.bake_protocol import StoreReader
from relume.store.optional_arrays import read_optional

F32 = NDArray[np.float32]


def read_patches(store: StoreReader) -> PatchLight:
    """Read the patches of a store."""
    points, visible = read_patch_points(store), store.read("patches/visibility")
    gather_hits, material = store.read("patches/gather_hits"), store.read("patches/material")
    points_per_patch = store.shape("patches/normal")[1]
    return PatchLight(
        points,
        visible.reshape(len(material), points_per_patch, visible.shape[1] // points_per_patch),
        gather_hits,
        make_pattern(gather_hits.shape[1] // points_per_patch, 0, int(store.attributes["gather_seed"])),
        material,
        np.stack([store.read(f"patches/{texture}") for texture in TEXTURES]),
        read_optional(store, "patches/uv"),
        read_optional(store, "patches/surface_normal"),
    )
