"""Cached incident light of BTFs; it serves all their texels."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from relume.brdf.terms.btf import BtfRef
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.material_image import MaterialImage
from relume.live.fixed_camera.view_images import ViewImages
from relume.operators.texel_light import BtfIncidentLight, collect_light, incident_light_bytes

_BUDGET_DIVISOR = 4  # each takes at most this fraction of the memory budget


def _key(images: ViewImages, material: MaterialImage, btf_ref: BtfRef, light: Illumination) -> tuple[Hashable, ...]:
    grid_bytes = (array.tobytes() for array in btf_ref.btf.grid)
    return images.transfer.key, *images.view.sample_key(material.index), light, "arrived", *grid_bytes


def is_cacheable(images: ViewImages, material: MaterialImage, btf_ref: BtfRef) -> bool:
    """Return whether the incident light of a material fits the memory budget.

    Args:
        images: images of a view. material: its image. btf_ref: its BTF.
    """
    return _BUDGET_DIVISOR * incident_light_bytes(btf_ref, material.num_samples) <= images.cache.budget_bytes


def get_texel_light(
    images: ViewImages, material: MaterialImage, btf_ref: BtfRef, light: Illumination
) -> BtfIncidentLight | None:
    """Return the cached incident light of a material, or None; the rotation of the BTF may differ.

    Args:
        images: images of a view. material: its image. btf_ref: its BTF. light: the illumination.
    """
    return images.cache.get_cached(_key(images, material, btf_ref, light), BtfIncidentLight)


def put_texel_light(
    images: ViewImages,
    material: MaterialImage,
    btf_ref: BtfRef,
    light: Illumination,
    progress: Callable[[float], None],
    is_canceled: Callable[[], bool],
) -> BtfIncidentLight:
    """Return the incident light of a material in the frames of its BTF, computed and cached; replaces another rotation.

    Args:
        images: images of a view. material: its image. btf_ref: its BTF. light: the illumination.
        progress: called with the fraction done. is_canceled: polled regularly.
    Raises:
        CancelledError: `is_canceled` returned true.
    """
    cached = get_texel_light(images, material, btf_ref, light)
    if cached is not None and cached.rotation == btf_ref.rotation:
        return cached
    incident = collect_light(btf_ref, *images.incident_light(material, light, is_canceled), progress, is_canceled)
    key = _key(images, material, btf_ref, light)
    images.cache.evict(key)
    images.cache.get(key, BtfIncidentLight, incident.num_bytes, lambda: incident)
    return incident  # another session may have cached another rotation
