"""Scenes and bakes as JSON, with the field names of REST."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from relume.core.errors import bytes_text
from relume_cli.terminal.printing import iso_time
from relume_worker.status import FREE_CAMERA_METHODS

if TYPE_CHECKING:
    from relume.store.bake_protocol import Plan, Recipe
    from relume_worker.scenes import SceneRecord
    from relume_worker.service import BakeService
    from relume_worker.status import BakeStatus


def scene_document(record: SceneRecord, bakes: Sequence[BakeStatus]) -> dict[str, Any]:
    """Scene as JSON, with the ids of its bakes."""
    return {
        "id": record.id,
        "name": record.name,
        "created": iso_time(record.created),
        "views": [{"name": view, "is_placed": False} for view in record.views],
        "materials": list(record.materials),
        "objects": list(record.objects),
        "lights": list(record.lights),
        "variants": [{"name": name, "look": look} for name, look in record.variants.items()],
        "warnings": [warning.document() for warning in record.warnings],
        "triangles": record.num_triangles,
        "size": None if record.size is None else list(record.size),
        "import_options": dict(record.import_options),
        "bakes": [status.id for status in bakes],
    }


def bake_document(status: BakeStatus, service: BakeService) -> dict[str, Any]:
    """Current state of a bake as JSON."""
    since_s = None if status.phase_since is None else max(0.0, round(time.time() - status.phase_since, 1))
    return {
        "id": status.id,
        "scene": status.scene,
        "user": status.client,
        "created": iso_time(status.created),
        "state": status.state,
        "progress": status.progress,
        "phase": status.phase,
        "phase_seconds": since_s,
        "queue_position": status.queue_position,
        "rays_per_second": status.rays_per_second,
        "seconds_left": status.seconds_left,
        "bytes": status.bytes,
        "problem": status.problem,
        "code": status.code,
        "is_current": status.is_current,
        "recipe": recipe_document(status.recipe),
        "plan": plan_document(status.plan, service),
    }


def recipe_document(recipe: Recipe) -> dict[str, Any]:
    """Recipe as JSON."""
    return {
        "method": recipe.method,
        "views": list(recipe.views),
        "size": list(recipe.size),
        "lights": recipe.num_lights,
        "probes": recipe.num_probes if recipe.method in FREE_CAMERA_METHODS else None,
        "patches": recipe.num_patches,
        "gather_rays": recipe.gather_rays,
        "relightable": recipe.relightable,
        "cameras": [camera.document() for camera in recipe.cameras],
    }


def plan_document(plan: Plan, service: BakeService) -> dict[str, Any]:
    """Cost of a bake as JSON."""
    return {
        "view_samples": plan.num_view_samples,
        "rays": plan.num_rays,
        "store_bytes": plan.store_bytes,
        "peak_bytes": plan.peak_bytes,
        "seconds": service.estimate_seconds(plan),
    }


def recipe_text(recipe: Recipe) -> str:
    """Recipe in a few words."""
    width, height = recipe.size
    return f"{recipe.method}, {width}×{height}, {recipe.num_lights:,} lights, views {', '.join(recipe.views)}"


def plan_lines(plan: Plan, service: BakeService) -> list[str]:
    """Cost of a bake as lines of text."""
    seconds = service.estimate_seconds(plan)
    return [
        f"  {plan.num_view_samples:,} view samples, {plan.num_rays / 1e6:,.1f} M rays",
        f"  at most {bytes_text(plan.store_bytes)} of disk, {bytes_text(plan.peak_bytes)} of memory",
        "  time unknown: no bake has finished here yet" if seconds is None else f"  about {seconds:,.0f} s",
    ]
