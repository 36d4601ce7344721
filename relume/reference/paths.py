"""Light paths: those that a look shows, those of them that a method follows, and what is left out, in sentences."""

from __future__ import annotations

from relume.look import LightPaths, Look
from relume.scene.model import Scene

MAX_BOUNCES = 64  # between surfaces, of which Russian roulette leaves few


def unlimited_paths(look: Look) -> LightPaths:
    """All light paths of the kind that a look shows, however many surfaces they have on their way.

    Args:
        look: whose `transport` names the kind.
    """
    return look.transport.model_copy(update={"bounces": MAX_BOUNCES}).paths


def omitted_paths(look: Look, *, reflects: bool) -> tuple[str, ...]:
    """What a method leaves out of the paths of a look, in sentences.

    Args:
        look: whose `transport` names them. reflects: whether the method has light between surfaces.
    """
    unlimited, supported = unlimited_paths(look), look.transport.supported_by(has_indirect=reflects)
    if not unlimited.has_indirect or supported.last >= unlimited.last:
        return ()
    if not supported.has_indirect:
        return ("Light that surfaces reflect onto each other, but for what is seen in mirrors.",)
    return (f"Light that more than {supported.last} surfaces have reflected.",)


def unsupported_paths(scene: Scene) -> tuple[str, ...]:
    """What brute force leaves out of a scene's light as every method does, in sentences.

    Args:
        scene: whose materials are looked at.
    """
    if any(material.glass is not None and material.glass.thickness > 0 for material in scene.materials):
        return ("Light that solid glass bends onto surfaces, and what its inner sides reflect.",)
    return ()
