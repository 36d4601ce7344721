"""The end of every import: warnings in order and in bounds, then a checked scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from relume.scene.archive import make_scene
from relume.scene.model import Camera, Environment, Light, Material, Mesh, Scene
from relume.scene.remarks import EFFECTS, Remark

MAX_WARNINGS = 200


def finished_scene(
    name: str,
    meshes: Sequence[Mesh],
    materials: Sequence[Material],
    cameras: Sequence[Camera],
    environment: Environment,
    warnings: Sequence[Remark],
    variants: Mapping[str, dict[str, Any]] | None = None,
    lights: Sequence[Light] = (),
) -> Scene:
    """As `make_scene`, the warnings that weigh most first and no more than `MAX_WARNINGS`. Raises SceneError."""
    found = [*environment.warnings, *warnings]
    listed = sorted(found, key=lambda remark: EFFECTS.index(remark.effect))[:MAX_WARNINGS]
    if len(found) > len(listed):
        listed.append(Remark(f"and {len(found) - len(listed):,} more of the kind", listed[-1].effect))
    return make_scene(name, meshes, materials, cameras, environment, listed, variants, lights)
