"""What the memory knows of light at textures that look different from every side: it serves all their texels."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from relume.brdf.terms.btf import Texels
from relume.operators.arrived import Arrived, arrive, arrived_bytes
from relume.picture.light import Light
from relume.picture.material_image import MaterialImage
from relume.picture.view_images import ViewImages

_SHARE = 4  # of the memory that one may take


def _key(images: ViewImages, material: MaterialImage, texels: Texels, light: Light) -> tuple[Hashable, ...]:
    rings = (part.tobytes() for part in texels.btf.rings)
    return images.transfer.key, *images.view.place(material.index), light, "arrived", *rings


def may_be_kept(images: ViewImages, material: MaterialImage, texels: Texels) -> bool:
    """Whether the memory has room for what arrives at a material, beside other things.

    Args:
        images: of a view. material: of these. texels: how it is covered.
    """
    return _SHARE * arrived_bytes(texels, material.num_samples) <= images.cache.budget_bytes


def known_arrived(images: ViewImages, material: MaterialImage, texels: Texels, light: Light) -> Arrived | None:
    """What arrives at a material in a light, where the memory has it; for a texture that may be turned otherwise.

    Args:
        images: of a view. material: of these. texels: how it is covered. light: what arrives.
    """
    return images.cache.find(_key(images, material, texels, light), Arrived)


def keep_arrived(
    images: ViewImages,
    material: MaterialImage,
    texels: Texels,
    light: Light,
    progress: Callable[[float], None],
    cancelled: Callable[[], bool],
) -> Arrived:
    """What arrives at a material in a light, in the frames of a texture as it is turned now; kept in place of what was
    known of it turned otherwise.

    Args:
        images: of a view. material: of these. texels: how it is covered. light: what arrives.
        progress: called with the share done. cancelled: asked now and then.
    Raises:
        CancelledError: `cancelled` said so.
    """
    known = known_arrived(images, material, texels, light)
    if known is not None and known.rotation == texels.rotation:
        return known
    made = arrive(texels, *images.arriving(material, light, cancelled), progress, cancelled)
    key = _key(images, material, texels, light)
    images.cache.forget(key)
    images.cache.get(key, Arrived, made.num_bytes, lambda: made)
    return made  # another session may have put a texture that is turned otherwise into its place
