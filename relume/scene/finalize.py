"""The end of every import: warnings in order and in bounds, then a checked scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from relume.assets.environments.environment import Environment
from relume.core.import_warnings import SEVERITIES, ImporterWarning
from relume.scene.model import Camera, Light, Material, Mesh, Scene
from relume.scene.scene_folder import make_scene

MAX_WARNINGS = 200


def finalize(
    name: str,
    meshes: Sequence[Mesh],
    materials: Sequence[Material],
    cameras: Sequence[Camera],
    environment: Environment,
    warnings: Sequence[ImporterWarning],
    variants: Mapping[str, dict[str, Any]] | None = None,
    lights: Sequence[Light] = (),
) -> Scene:
    """The scene of an imported file: as `make_scene`, the warnings that weigh most first and at most `MAX_WARNINGS`.

    Args:
        name: what people call the scene.
        meshes, materials, cameras: at least one of each; a mesh's `material` counts in `materials`.
        environment: the distant light.
        warnings: what the importer did not understand, one sentence each.
        variants: partial looks by name.
        lights: local lights, each of a name of its own.
    Raises:
        SceneError: the parts do not make a scene (see `relume.scene.validate`).
    """
    all_warnings = [*environment.warnings, *warnings]
    sorted_warnings = sorted(all_warnings, key=lambda warning: SEVERITIES.index(warning.severity))[:MAX_WARNINGS]
    if len(all_warnings) > len(sorted_warnings):
        sorted_warnings.append(
            ImporterWarning(
                f"and {len(all_warnings) - len(sorted_warnings):,} more of the kind", sorted_warnings[-1].severity
            )
        )
    return make_scene(name, meshes, materials, cameras, environment, sorted_warnings, variants, lights)
