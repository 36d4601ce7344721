"""Saved cameras: stored, listed, deleted with their scene, and part of recipes."""

import math
from pathlib import Path

import numpy as np
import pytest
from sqlalchemy import delete
from sqlalchemy.orm import Session
from tiny_scenes import still_life

from relume.core.errors import NotFoundError, ParameterError, PlanError
from relume.methods.registry import METHODS
from relume.scene.custom_camera import CustomCamera, make_custom_camera
from relume.scene.model import Scene
from relume.store.bake_protocol import Recipe
from relume.store.publish import array_paths
from relume.store.reader import open_store
from relume.store.run_bake import bake_in_process
from relume_worker import cameras
from relume_worker.cameras import camera_names_by_scene, delete_camera, list_cameras, resolve_views, store_camera
from relume_worker.database import open_database
from relume_worker.database.models import SceneRow
from relume_worker.ledger import Ledger
from relume_worker.scenes import SceneRecord, delete_scene, get_scene, register_scene
from relume_worker.status import recipe_from_json, recipe_json

METHOD = METHODS["direct"]


@pytest.fixture(scope="module")
def scene() -> Scene:
    return still_life()


def renamed_camera(scene: Scene, name: str, yfov: float | None = None) -> CustomCamera:
    """The scene's first camera under another name."""
    first = scene.cameras[0]
    return make_custom_camera(name, first.to_world.ravel().tolist(), yfov or math.degrees(first.yfov))


@pytest.fixture
def ledger(tmp_path: Path, scene: Scene) -> Ledger:
    ledger = Ledger(open_database(f"sqlite:///{tmp_path / 'relume.db'}"))
    register_scene(tmp_path, ledger, scene)
    return ledger


@pytest.fixture
def record(ledger: Ledger, scene: Scene) -> SceneRecord:
    return get_scene(ledger, scene.id)


def test_cameras_are_saved_replaced_and_deleted_with_their_scene(tmp_path: Path, ledger: Ledger, scene: Scene) -> None:
    wide, narrow = renamed_camera(scene, "Hero", 60), renamed_camera(scene, "Hero", 20)
    assert store_camera(ledger, scene.id, wide)
    assert not store_camera(ledger, scene.id, narrow)
    store_camera(ledger, scene.id, renamed_camera(scene, "Behind"))
    assert list_cameras(ledger, scene.id) == [renamed_camera(scene, "Behind"), narrow]
    assert camera_names_by_scene(ledger) == {scene.id: ["Behind", "Hero"]}
    delete_camera(ledger, scene.id, "Behind")
    with pytest.raises(NotFoundError):
        delete_camera(ledger, scene.id, "Behind")
    delete_scene(tmp_path, ledger, scene.id)
    assert camera_names_by_scene(ledger) == {}


def test_names_of_scene_cameras_and_excess_cameras_are_rejected(
    ledger: Ledger, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = scene.cameras[0].name
    with pytest.raises(ParameterError, match="camera of the scene's file"):
        store_camera(ledger, scene.id, renamed_camera(scene, own))
    with pytest.raises(ParameterError, match="camera of the scene's file"):
        delete_camera(ledger, scene.id, own)
    monkeypatch.setattr(cameras, "MAX_CAMERAS", 1)
    store_camera(ledger, scene.id, renamed_camera(scene, "Hero"))
    store_camera(ledger, scene.id, renamed_camera(scene, "Hero", 60))
    with pytest.raises(ParameterError, match="or delete one"):
        store_camera(ledger, scene.id, renamed_camera(scene, "Behind"))
    with pytest.raises(NotFoundError):
        store_camera(ledger, "0" * 16, renamed_camera(scene, "Hero"))


def test_views_are_chosen_by_name_or_inline(ledger: Ledger, scene: Scene, record: SceneRecord) -> None:
    own, hero, behind = scene.cameras[0].name, renamed_camera(scene, "Hero"), renamed_camera(scene, "Behind")
    store_camera(ledger, scene.id, hero)
    assert resolve_views(ledger, record, []) == (record.views, ())
    assert resolve_views(ledger, record, ["Hero", own, behind, own]) == (("Hero", own, "Behind"), (hero, behind))
    with pytest.raises(ParameterError, match="Hero"):
        resolve_views(ledger, record, ["Nobody"])
    with pytest.raises(ParameterError, match="a different name for each camera"):
        resolve_views(ledger, record, ["Hero", renamed_camera(scene, "Hero", 60)])
    with pytest.raises(ParameterError, match="camera of the scene's file"):
        resolve_views(ledger, record, [renamed_camera(scene, own)])


def test_recipe_with_cameras_survives_json(scene: Scene) -> None:
    recipe = Recipe("direct", ("Hero",), (64, 48), 100, cameras=(renamed_camera(scene, "Hero", 31.7),))
    assert recipe_from_json(recipe_json(recipe)) == recipe


def test_view_of_a_saved_camera_equals_that_of_the_scene_camera(scene: Scene, tmp_path: Path) -> None:
    own = Recipe("direct", (scene.cameras[0].name,), (32, 24), 50)
    placed = Recipe("direct", ("Hero",), (32, 24), 50, cameras=(renamed_camera(scene, "Hero"),))
    stores = [
        open_store(bake_in_process(METHOD, scene, recipe, tmp_path / f"{recipe.views[0]}.zarr"))
        for recipe in (own, placed)
    ]
    paths = array_paths(tmp_path / "Hero.zarr")
    assert "views/0/visibility" in paths
    for path in paths:
        np.testing.assert_array_equal(stores[0].read(path), stores[1].read(path))
    assert stores[1].attributes["views"][0]["name"] == "Hero"


def test_view_without_a_camera_in_the_recipe_is_rejected(scene: Scene) -> None:
    with pytest.raises(PlanError, match="Hero"):
        METHOD.plan(scene, Recipe("direct", ("Hero",), (32, 24), 50))


def test_camera_of_a_concurrently_deleted_scene_is_not_saved(
    tmp_path: Path, ledger: Ledger, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    count = cameras._count

    def deleted_meanwhile(session: Session, scene_id: str) -> int:
        with session.bind.begin() as connection:  # type: ignore[union-attr]
            connection.execute(delete(SceneRow).where(SceneRow.id == scene_id))
        return count(session, scene_id)

    monkeypatch.setattr(cameras, "_count", deleted_meanwhile)
    with pytest.raises(NotFoundError):
        store_camera(ledger, scene.id, renamed_camera(scene, "Hero"))
