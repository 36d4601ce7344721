"""Bakes that a batch needs because its images have another size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from relume.store.bake_protocol import Recipe
from relume_server.schemas.renders import QueuedRender
from relume_worker.status import FREE_CAMERA_METHODS, BakeStatus, bake_id


def recipe_for_size(status: BakeStatus, request: QueuedRender) -> Recipe | None:
    """Return the recipe of a bake with the views and the size of a batch; None if the bake itself has the size.

    Args:
        status: of a bake. request: a batch of it.
    """
    recipe, size = status.recipe, request.size
    if not request.rebake or size is None or recipe.method in FREE_CAMERA_METHODS or recipe.size == size:
        return None
    views = tuple(view for bake, view in dict.fromkeys(request.bake_views) if bake == status.id)
    cameras = tuple(camera for camera in recipe.cameras if camera.name in views)
    return replace(recipe, size=size, views=views, cameras=cameras)


def use_bakes(request: QueuedRender, rebakes: Mapping[str, tuple[str, Recipe]]) -> None:
    """Render from other bakes of the same scenes.

    Args:
        request: the batch. rebakes: scene and recipe of the new bake, by the id of the old one.
    """
    ids = {bake: bake_id(scene, recipe) for bake, (scene, recipe) in rebakes.items()}
    request.bake = ids.get(request.bake, request.bake)
    request.views = [
        each.model_copy(update={"bake": ids[each.bake]}) if each.bake in ids else each for each in request.views
    ]
