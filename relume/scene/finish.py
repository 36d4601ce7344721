"""The end of every import: warnings in order and in bounds, then a checked scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from relume.scene.archive import make_scene
from relume.scene.model import Camera, Environment, Light, Material, Mesh, Scene

MAX_WARNINGS = 200


def finished_scene(
    name: str,
    meshes: Sequence[Mesh],
    materials: Sequence[Material],
    cameras: Sequence[Camera],
    environment: Environment,
    warnings: Sequence[str],
    variants: Mapping[str, dict[str, Any]] | None = None,
    lights: Sequence[Light] = (),
) -> Scene:
    """As `make_scene`, the environment's warnings first and no more than `MAX_WARNINGS`. Raises SceneError."""
    listed = [*environment.warnings, *warnings]
    if len(listed) > MAX_WARNINGS:
        listed = [*listed[:MAX_WARNINGS], f"and {len(listed) - MAX_WARNINGS:,} more of the kind"]
    return make_scene(name, meshes, materials, cameras, environment, listed, variants, lights)
