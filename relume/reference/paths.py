"""Light paths of a look, those that a method supports, and sentences about omitted paths."""

from __future__ import annotations

from relume.look import LightPaths, Look
from relume.scene.model import Scene

MAX_BOUNCES = 64  # Russian roulette ends most paths earlier


def unlimited_paths(look: Look) -> LightPaths:
    """All light paths of the kind that a look selects, with any number of bounces.

    Args:
        look: its `transport` selects the kind.
    """
    return look.transport.model_copy(update={"bounces": MAX_BOUNCES}).paths


def omitted_paths(look: Look, *, reflects: bool) -> tuple[str, ...]:
    """Paths of a look that a method omits, in sentences.

    Args:
        look: its `transport` selects the paths. reflects: the method has indirect light.
    """
    unlimited, supported = unlimited_paths(look), look.transport.supported_by(has_indirect=reflects)
    if not unlimited.has_indirect or supported.last >= unlimited.last:
        return ()
    if not supported.has_indirect:
        return ("Indirect light, except reflections in mirrors.",)
    return (f"Light after more than {supported.last} bounces.",)


def unsupported_paths(scene: Scene) -> tuple[str, ...]:
    """Paths of a scene's light that the reference omits like every method, in sentences.

    Args:
        scene: its materials determine the paths.
    """
    if any(material.glass is not None and material.glass.thickness > 0 for material in scene.materials):
        return ("Caustics of solid glass, and reflections on its inner sides.",)
    return ()
