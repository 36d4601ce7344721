"""Settings, bake service, scenes and bakes of a data directory, for commands."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume.core.errors import Description, NotFoundError
from relume_cli.name_lookup import match_name

if TYPE_CHECKING:
    from relume.look import Look
    from relume_server.settings import Settings
    from relume_worker.ledger import Ledger
    from relume_worker.scenes import SceneRecord
    from relume_worker.service import BakeService
    from relume_worker.status import BakeStatus

MIN_BAKE_ID_LENGTH = 8  # shortest prefix of a bake's id that is accepted


def open_settings(data: Path | None, **overrides: Any) -> Settings:
    """Settings from the environment and the command line, which takes precedence. Also registers the asset stores.

    Raises:
        ParameterError: a setting is invalid.
    """
    if data is not None and re.match(r"[A-Za-z0-9+]+:/", str(data)):
        _refuse_url()
    from pydantic import ValidationError
    from pydantic_settings import SettingsError

    from relume.core.errors import ParameterError
    from relume.image_io.ocio.active_config import use_config
    from relume_server.runtime.assets import list_asset_stores
    from relume_server.settings import Settings
    from relume_server.validation_errors import describe_allowed

    values = {key: value for key, value in {"data": data, **overrides}.items() if value is not None}
    try:
        settings = Settings(**values)
    except ValidationError as error:
        first = error.errors()[0]
        field, *within = map(str, first["loc"])
        name = ".".join((f"RELUME_{field.upper()}", *within))
        value = Description("not usable") if field.endswith("_secret") else first["input"]
        raise ParameterError(name, value, describe_allowed(first["loc"], [first])) from None
    except SettingsError as error:  # names the field only in its message
        variable = "RELUME_" + "".join(str(error).split('"')[1:2]).upper()
        allowed = """JSON, as '["10.0.0.5"]' or '{"Ann": "edit"}', quoted for the shell"""
        raise ParameterError(variable, os.environ.get(variable), allowed) from None
    settings.data.mkdir(mode=0o700, parents=True, exist_ok=True)
    for store, folder in list_asset_stores(settings.data):
        store.add_search_folder(folder)
    use_config(settings.ocio, settings.ocio_space)
    return settings


def _refuse_url() -> None:
    """Raise ParameterError: other users can read the arguments of a process, and a URL contains a password."""
    from relume.core.errors import ParameterError

    raise ParameterError("--data", Description("a URL"), "a directory, and set RELUME_DATABASE to the database's URL")


@contextmanager
def private_files() -> Iterator[None]:
    """Files written inside, also by child processes, are readable by this user only."""
    previous_mask = os.umask(0o077)
    try:
        yield
    finally:
        os.umask(previous_mask)


def open_bakes(settings: Settings) -> BakeService:
    """Bake service of a data directory, not started."""
    from relume_worker.service import BakeService

    return BakeService(settings.data, settings.database_url, settings.scheduler)


def check_used(settings: Settings) -> None:
    """Raise ParameterError if a data directory has neither a database nor imported assets."""
    from relume.core.errors import ParameterError
    from relume_server.runtime.assets import list_asset_stores

    paths = settings.data / "relume.db", *(folder for _, folder in list_asset_stores(settings.data))
    if not settings.database and not any(path.exists() for path in paths):
        raise ParameterError(
            "--data", str(settings.data), "a directory that relume has used, because this one is empty"
        )


def find_scene(ledger: Ledger, name: str) -> SceneRecord:
    """Find a scene by id, start of an id, or name. Raises NotFoundError if there is none, or more than one."""
    from relume_cli.name_lookup import pick
    from relume_worker.scenes import list_scenes

    scenes = {scene.id: scene for scene in list_scenes(ledger)}
    candidates = [(scene.id, scene.name) for scene in scenes.values()]
    return scenes[pick("scene", name, candidates, "relume import adds scenes")]


def bakes_by_prefix(service: BakeService, name: str) -> list[BakeStatus]:
    """Bakes whose id begins with a name of at least `MIN_BAKE_ID_LENGTH` characters."""
    return [bake for bake in service.bakes() if len(name) >= MIN_BAKE_ID_LENGTH and bake.id.startswith(name)]


def find_bake_and_view(
    service: BakeService, name: str, view: str | None, *, is_free_camera: bool = False
) -> tuple[SceneRecord, BakeStatus, str]:
    """Find a finished bake by its id, the start of its id, or a scene's name.

    Args:
        service: service of the data directory. name: name of a bake or a scene; the finest bake of a scene is taken.
        view, is_free_camera: as for `find_bake`.
    Returns:
        The scene, the bake, and the view.
    Raises:
        NotFoundError: there is none, it is not finished, or it does not have the view.
    """
    matches = bakes_by_prefix(service, name)
    if len(matches) != 1:
        scene = find_scene(service.ledger, name)
        return scene, *find_bake(service, scene, view, is_free_camera=is_free_camera)
    bake = matches[0]
    view = None if view is None else match_name(view, bake.recipe.views)
    _check_bake_and_view(bake, view, is_free_camera)
    return find_scene(service.ledger, bake.scene), bake, view or bake.recipe.views[0]


def _check_bake_and_view(bake: BakeStatus, view: str | None, is_free_camera: bool) -> None:
    """Raise NotFoundError if a bake is not finished, lacks the view, or has fixed cameras only."""
    from relume_worker.status import FREE_CAMERA_METHODS

    if bake.state != "ready":
        raise NotFoundError(f"bake {bake.id} is {bake.state}, not ready; resume it: relume bake {bake.scene}")
    if view is not None and view not in bake.recipe.views:
        raise NotFoundError(f"bake {bake.id} has no view {view[:80]!r}; its views are {', '.join(bake.recipe.views)}")
    if is_free_camera and bake.recipe.method not in FREE_CAMERA_METHODS:
        raise NotFoundError(f"bake {bake.id} has fixed cameras only; run: relume bake {bake.scene} --method probes")


def find_bake(
    service: BakeService, scene: SceneRecord, view: str | None, *, is_free_camera: bool = False
) -> tuple[BakeStatus, str]:
    """Return the finest finished bake of a scene that has the view, and the view. Raises NotFoundError.

    Args:
        service, scene: service and scene of the data directory. view: name; None: any.
        is_free_camera: accept free-camera bakes only.
    """
    from relume_worker.status import FREE_CAMERA_METHODS

    ready = [bake for bake in service.bakes(scene.id) if bake.state == "ready"]
    if is_free_camera:
        ready = [bake for bake in ready if bake.recipe.method in FREE_CAMERA_METHODS]
    view_names = dict.fromkeys((*scene.views, *(baked_view for bake in ready for baked_view in bake.recipe.views)))
    view = None if view is None else match_name(view, view_names)
    if view is not None and view not in view_names:
        raise NotFoundError(f"the scene has no view {view[:80]!r}; its views are {', '.join(view_names)[:400]}")
    candidates = [bake for bake in ready if view is None or view in bake.recipe.views]
    if not candidates:
        option = " --method probes" if is_free_camera else ""
        raise NotFoundError(f"there is no finished bake of {scene.name!r} yet; run: relume bake {scene.id}{option}")
    finest = max(candidates, key=lambda bake: bake.rank)
    return finest, view or finest.recipe.views[0]


def complete_look(partial: dict[str, Any], default: dict[str, Any], name: str = "--look") -> Look:
    """Complete a look document with the scene's default, and validate it.

    Args:
        partial, default: documents. name: name of the look, in messages.
    Raises:
        ParameterError: with the name of the look and the JSON pointer.
    """
    from relume.core.errors import ParameterError
    from relume.look import complete, validate

    try:
        return validate(complete(partial, default), default)
    except ParameterError as error:
        raise ParameterError(f"{name}: {error.name}", error.value, error.allowed) from None
