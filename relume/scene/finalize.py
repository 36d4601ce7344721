"""The last step of every import: sorts and limits the warnings, then builds a validated scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from relume.assets.environments.environment import Environment
from relume.core.import_warnings import ImporterWarning, by_severity
from relume.scene.model import Camera, Light, Material, Mesh, Scene
from relume.scene.scene_folder import make_scene

MAX_WARNINGS = 200
MAX_REFUSAL = 380  # characters


def finalize(
    name: str,
    meshes: Sequence[Mesh],
    materials: Sequence[Material],
    cameras: Sequence[Camera],
    environment: Environment,
    warnings: Sequence[ImporterWarning],
    variants: Mapping[str, dict[str, Any]] | None = None,
    lights: Sequence[Light] = (),
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Scene:
    """Make the scene of an imported file; the most severe warnings come first, at most `MAX_WARNINGS`.

    Args:
        name: shown to users.
        meshes, materials, cameras: at least one of each; a mesh's `material` is an index into `materials`.
        environment: the distant light.
        warnings: warnings of the importer, one sentence each.
        variants: partial looks by name.
        lights: local lights with unique names.
        offset: what was subtracted from the file's positions, meters.
    Raises:
        SceneError: the arguments are not a valid scene (see `relume.scene.validate`).
    """
    all_warnings = sort_warnings([*environment.warnings, *warnings])
    return make_scene(name, meshes, materials, cameras, environment, all_warnings, variants, lights, offset)


def sort_warnings(warnings: Sequence[ImporterWarning]) -> list[ImporterWarning]:
    """Return at most `MAX_WARNINGS`, the most severe first, and one about the rest."""
    sorted_warnings = by_severity(warnings)
    if len(sorted_warnings) > MAX_WARNINGS:
        num_omitted = len(sorted_warnings) - MAX_WARNINGS
        more = ImporterWarning(f"… and {num_omitted:,} more.", sorted_warnings[MAX_WARNINGS - 1].severity)
        return [*sorted_warnings[:MAX_WARNINGS], more]
    return sorted_warnings


def no_triangles(warnings: Sequence[ImporterWarning], contents: str) -> str:
    """Why there is nothing to show, with the faults of the file.

    Args:
        warnings: of the import. contents: of a file without faults, as a clause.
    """
    unsupported = (str(warning) for warning in warnings if warning.severity == "unsupported")
    faults = [fault.rstrip(".") for fault in dict.fromkeys(unsupported)] or [contents]
    message, left = "the scene has no triangles with an area; export at least one mesh made of triangles", 0
    while faults and len(message) + len("; ".join(faults)) > MAX_REFUSAL:  # whole sentences, as many as fit
        faults, left = faults[:-1], left + 1
    more = [f"and {left} more" if faults else "nothing in it is supported"] if left else []
    message += f" ({'; '.join([*faults, *more])})"
    return "".join(character if character.isprintable() else " " for character in message)
