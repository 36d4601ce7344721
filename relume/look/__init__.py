"""The look: the JSON document that users edit. Documents are immutable: no function here modifies its arguments."""

from relume.look.document import complete, default_look, validate
from relume.look.model import (
    BAKED_ENVIRONMENT,
    EnvironmentKey,
    LightGeometry,
    LightLook,
    LightPaths,
    Look,
    MaterialLook,
    TermLook,
)
from relume.look.patch import apply_patch

__all__ = [
    "BAKED_ENVIRONMENT",
    "EnvironmentKey",
    "LightGeometry",
    "LightLook",
    "LightPaths",
    "Look",
    "MaterialLook",
    "TermLook",
    "apply_patch",
    "complete",
    "default_look",
    "validate",
]
