"""What the memory knows of light at textures that look different from every side: it serves all their texels."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from relume.brdf.terms.btf import BtfRef
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.material_image import MaterialImage
from relume.live.fixed_camera.view_images import ViewImages
from relume.operators.texel_light import BtfIncidentLight, collect_light, incident_light_bytes

_BUDGET_DIVISOR = 4  # of the memory that one may take


def _key(images: ViewImages, material: MaterialImage, btf_ref: BtfRef, light: Illumination) -> tuple[Hashable, ...]:
    grid_bytes = (array.tobytes() for array in btf_ref.btf.grid)
    return images.transfer.key, *images.view.sample_key(material.index), light, "arrived", *grid_bytes


def is_cacheable(images: ViewImages, material: MaterialImage, btf_ref: BtfRef) -> bool:
    """Whether the memory has room for what arrives at a material, beside other things.

    Args:
        images: of a view. material: of these. btf_ref: how it is covered.
    """
    return _BUDGET_DIVISOR * incident_light_bytes(btf_ref, material.num_samples) <= images.cache.budget_bytes


def get_texel_light(
    images: ViewImages, material: MaterialImage, btf_ref: BtfRef, light: Illumination
) -> BtfIncidentLight | None:
    """What arrives at a material in a light, where the memory has it; for a texture that may be turned otherwise.

    Args:
        images: of a view. material: of these. btf_ref: how it is covered. light: what arrives.
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
    """What arrives at a material in a light, in the frames of a texture as it is turned now; kept in place of what was
    known of it turned otherwise.

    Args:
        images: of a view. material: of these. btf_ref: how it is covered. light: what arrives.
        progress: called with the share done. is_canceled: asked now and then.
    Raises:
        CancelledError: `is_canceled` said so.
    """
    cached = get_texel_light(images, material, btf_ref, light)
    if cached is not None and cached.rotation == btf_ref.rotation:
        return cached
    incident = collect_light(btf_ref, *images.incident_light(material, light, is_canceled), progress, is_canceled)
    key = _key(images, material, btf_ref, light)
    images.cache.evict(key)
    images.cache.get(key, BtfIncidentLight, incident.num_bytes, lambda: incident)
    return incident  # another session may have put a texture that is turned otherwise into its place
