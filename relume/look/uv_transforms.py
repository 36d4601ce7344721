"""Transforms of texture coordinates in a look: validation, and the materials that cannot have one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from relume.core.errors import Description, ParameterError
from relume.core.validation import Pointer, check_number, check_object, invalid_value, is_number, pointer_text
from relume.look.model import Look, MeshLook
from relume.math.uv_transform import UvTransform
from relume.scene.model import Scene

MIN_SCALE, MAX_SCALE = 1e-3, 1e3
MAX_OFFSET = 1e3
MAX_ROTATION = 360.0
_IDENTITY: dict[str, Any] = {"scale": [1.0, 1.0], "rotation": 0.0, "offset": [0.0, 0.0]}


def complete_uv(pointer: Pointer, partial: Any, terms: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the `uv` of a material as a field to add to it; empty for the identity.

    Args:
        pointer: location in the look. partial: fields to change; None: the identity. terms: of the material, complete.
    Raises:
        ParameterError: a value is invalid, or the material has a BTF.
    """
    if partial is None:
        return {}
    check_object(pointer, partial, _IDENTITY)
    fields = {**_IDENTITY, **partial}
    for name in ("scale", "offset"):
        if not isinstance(fields[name], list | tuple) or len(fields[name]) != 2:
            raise invalid_value((*pointer, name), fields[name], "two numbers, of u and v")
    for k, value in enumerate(fields["scale"]):
        if not is_number(value) or not MIN_SCALE <= abs(value) <= MAX_SCALE:
            allowed = f"a number from {MIN_SCALE:g} to {MAX_SCALE:g}, or a negative one to mirror"
            raise invalid_value((*pointer, "scale", k), value, allowed)
    check_number((*pointer, "rotation"), fields["rotation"], -MAX_ROTATION, MAX_ROTATION)
    for k, value in enumerate(fields["offset"]):
        check_number((*pointer, "offset", k), value, -MAX_OFFSET, MAX_OFFSET)
    if UvTransform(tuple(fields["offset"]), fields["rotation"], tuple(fields["scale"])) == UvTransform():
        return {}
    if any(term["model"] == "measured_btf" for term in terms):
        raise _unsupported(pointer, "a BTF")
    return {"uv": fields}


def check_uv_transforms(look: Look, fixed: Mapping[str, str]) -> None:
    """Reject transforms on materials with images that cannot be transformed.

    Args:
        look: a complete look. fixed: the image that a material of the scene has, by its name.
    Raises:
        ParameterError: a material has such an image, or the look makes it emit one.
    """
    emitters = {light.material for light in look.lights.values() if isinstance(light, MeshLook) and light.image}
    for name, material in look.materials.items():
        if material.uv_transform is None:
            continue
        if (image := fixed.get(material.base or name)) is not None:
            raise _unsupported(("materials", name, "uv"), image)
        if name in emitters:
            raise _unsupported(("materials", name, "uv"), "an emission image")


def fixed_images(scene: Scene) -> dict[str, str]:
    """Return the image of each material of a scene that has one which cannot be transformed."""
    cutouts = (m.name for m in scene.materials if m.opacity is not None and m.opacity.alpha.size > 1)
    emitters = (m.name for m in scene.materials if "emission" in m.textures)
    return dict.fromkeys(cutouts, "an opacity image") | dict.fromkeys(emitters, "an emission image")


def _unsupported(pointer: Pointer, image: str) -> ParameterError:
    return ParameterError(pointer_text(pointer), Description("a transform"), f"null, since this material has {image}")
