"""The last step of every import: sorts and limits the warnings, then builds a validated scene."""

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
    """Make the scene of an imported file; the most severe warnings come first, at most `MAX_WARNINGS`.

    Args:
        name: shown to users.
        meshes, materials, cameras: at least one of each; a mesh's `material` is an index into `materials`.
        environment: the distant light.
        warnings: warnings of the importer, one sentence each.
        variants: partial looks by name.
        lights: local lights with unique names.
    Raises:
        SceneError: the arguments are not a valid scene (see `relume.scene.validate`).
    """
    all_warnings = [*environment.warnings, *warnings]
    sorted_warnings = sorted(all_warnings, key=lambda warning: SEVERITIES.index(warning.severity))[:MAX_WARNINGS]
    if len(all_warnings) > len(sorted_warnings):
        num_omitted = len(all_warnings) - len(sorted_warnings)
        sorted_warnings.append(ImporterWarning(f"… and {num_omitted:,} more.", sorted_warnings[-1].severity))
    return make_scene(name, meshes, materials, cameras, environment, sorted_warnings, variants, lights)
