"""Light paths: those that a look shows, those of them that a method follows, and what is left out, in sentences."""

from __future__ import annotations

from relume.look import Look, Paths
from relume.scene.model import Scene

MOST_BOUNCES = 64  # between surfaces, of which Russian roulette leaves few


def whole_paths(look: Look) -> Paths:
    """All light paths of the kind that a look shows, however many surfaces they have on their way.

    Args:
        look: whose `transport` names the kind.
    """
    return look.transport.model_copy(update={"bounces": MOST_BOUNCES}).paths


def left_out(look: Look, *, reflects: bool) -> tuple[str, ...]:
    """What a method leaves out of the paths of a look, in sentences.

    Args:
        look: whose `transport` names them. reflects: whether the method has light between surfaces.
    """
    whole, followed = whole_paths(look), look.transport.followed(reflects=reflects)
    if not whole.reflect or followed.last >= whole.last:
        return ()
    if not followed.reflect:
        return ("Light that surfaces reflect onto each other, but for what is seen in mirrors.",)
    return (f"Light that more than {followed.last} surfaces have reflected.",)


def untraced(scene: Scene) -> tuple[str, ...]:
    """What brute force leaves out of a scene's light as every method does, in sentences.

    Args:
        scene: whose materials are looked at.
    """
    if any(material.glass is not None and material.glass.thickness > 0 for material in scene.materials):
        return ("Light that solid glass bends onto surfaces, and what its inner sides reflect.",)
    return ()
