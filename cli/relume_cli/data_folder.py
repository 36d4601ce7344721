"""What commands need of the rest: settings, the bake service, a scene by the name people give it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume.core.errors import NotFoundError
from relume_cli.name_lookup import match_name

if TYPE_CHECKING:
    from relume.look import Look
    from relume_server.settings import Settings
    from relume_worker.ledger import Ledger
    from relume_worker.scenes import SceneRecord
    from relume_worker.service import BakeService
    from relume_worker.status import BakeStatus


def open_settings(data: Path | None, **overrides: Any) -> Settings:
    """Settings from the environment, with what the command line says in their place; what was imported can be named.

    Raises:
        ParameterError: a setting cannot be what it is.
    """
    if data is not None and re.match(r"[A-Za-z0-9+]+:/", str(data)):
        _refuse_url()
    from pydantic import ValidationError
    from pydantic_settings import SettingsError

    from relume.core.errors import ParameterError
    from relume.image_io.ocio.active_config import use_config
    from relume_server.runtime.assets import list_asset_stores
    from relume_server.settings import Settings

    values = {key: value for key, value in {"data": data, **overrides}.items() if value is not None}
    try:
        settings = Settings(**values)
    except ValidationError as error:
        first = error.errors()[0]
        field, *within = map(str, first["loc"])
        name = ".".join((f"RELUME_{field.upper()}", *within))
        raise ParameterError(name, first["input"], _allowed(first["msg"])) from None
    except SettingsError as error:  # which tells the field in its words alone
        variable = "RELUME_" + "".join(str(error).split('"')[1:2]).upper()
        allowed = """JSON, as '["10.0.0.5"]' or '{"Ann": "edit"}', in quotes of the shell"""
        raise ParameterError(variable, os.environ.get(variable), allowed) from None
    settings.data.mkdir(mode=0o700, parents=True, exist_ok=True)
    for store, folder in list_asset_stores(settings.data):
        store.add_search_folder(folder)
    use_config(settings.ocio, settings.ocio_space)
    return settings


def _refuse_url() -> None:
    """Raise ParameterError: everybody on the machine reads the arguments of a process, and a URL has a password."""
    from relume.core.errors import ParameterError

    raise ParameterError("--data", "a URL", "a folder; the database's URL goes into the variable RELUME_DATABASE")


@contextmanager
def private_files() -> Iterator[None]:
    """What is written inside, by processes that are started as well, is for this user alone."""
    previous_mask = os.umask(0o077)
    try:
        yield
    finally:
        os.umask(previous_mask)


def _allowed(message: str) -> str:
    """What pydantic says of a value, to stand behind "give"."""
    text = message.removeprefix("Input should be ").removeprefix("Value error, ")
    return text[:1].lower() + text[1:]


def open_bakes(settings: Settings) -> BakeService:
    """The bake service of a data folder, not started."""
    from relume_worker.service import BakeService

    return BakeService(settings.data, settings.database_url, settings.scheduler)


def check_used(settings: Settings) -> None:
    """Raise ParameterError where a data folder has neither a ledger nor anything that was imported."""
    from relume.core.errors import ParameterError
    from relume_server.runtime.assets import list_asset_stores

    paths = settings.data / "relume.db", *(folder for _, folder in list_asset_stores(settings.data))
    if not settings.database and not any(path.exists() for path in paths):
        raise ParameterError("--data", str(settings.data), "a folder that relume has used; this one is empty")


def find_scene(ledger: Ledger, name: str) -> SceneRecord:
    """A scene by id, start of an id, or name. Raises NotFoundError where there is none or more than one."""
    from relume_cli.name_lookup import pick
    from relume_worker.scenes import list_scenes

    scenes = {scene.id: scene for scene in list_scenes(ledger)}
    candidates = [(scene.id, scene.name) for scene in scenes.values()]
    return scenes[pick("scene", name, candidates, "relume import adds one")]


def find_bake_and_view(
    service: BakeService, name: str, view: str | None, *, is_free_camera: bool = False
) -> tuple[SceneRecord, BakeStatus, str]:
    """What a bake's id, the start of one, or a scene's name stands for: the scene, a finished bake of it, and the view.

    Args:
        service: where to look. name: of the bake, or of a scene: then the finest one. view, is_free_camera: as of
            `find_bake`.
    Raises:
        NotFoundError: there is none, it is not finished, or it does not have the view.
    """
    matches = [bake for bake in service.bakes() if len(name) >= 8 and bake.id.startswith(name)]
    if len(matches) != 1:
        scene = find_scene(service.ledger, name)
        return scene, *find_bake(service, scene, view, is_free_camera=is_free_camera)
    bake = matches[0]
    view = None if view is None else match_name(view, bake.recipe.views)
    _check_bake_and_view(bake, view, is_free_camera)
    return find_scene(service.ledger, bake.scene), bake, view or bake.recipe.views[0]


def _check_bake_and_view(bake: BakeStatus, view: str | None, is_free_camera: bool) -> None:
    """Raise NotFoundError where a bake that was asked for by its id is not finished, or lacks what is to be shown."""
    from relume_worker.status import FREE_CAMERA_METHODS

    if bake.state != "ready":
        raise NotFoundError(f"bake {bake.id} is {bake.state}, not ready; go on with it: relume bake {bake.scene}")
    if view is not None and view not in bake.recipe.views:
        raise NotFoundError(f"bake {bake.id} has no view {view[:80]!r}; its views are {', '.join(bake.recipe.views)}")
    if is_free_camera and bake.recipe.method not in FREE_CAMERA_METHODS:
        raise NotFoundError(f"bake {bake.id} is of fixed views; run: relume bake {bake.scene} --method probes")


def find_bake(
    service: BakeService, scene: SceneRecord, view: str | None, *, is_free_camera: bool = False
) -> tuple[BakeStatus, str]:
    """The finest finished bake of a scene that has the view, and the view. Raises NotFoundError.

    Args:
        service, scene: where to look, and what for. view: its name; None: any. is_free_camera: its eye must.
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
    """A checked look from what a file says and the scene's default.

    Args:
        partial, default: documents. name: of the look, in messages.
    Raises:
        ParameterError: naming the look and the place in it.
    """
    from relume.core.errors import ParameterError
    from relume.look import complete, validate

    try:
        return validate(complete(partial, default), default)
    except ParameterError as error:
        raise ParameterError(f"{name}: {error.name}", error.value, error.allowed) from None
