"""`relume delete`: delete scenes, bakes, looks, assets and jobs."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import typer

from relume_cli.database.small_assets import SmallAssetKind, small_assets
from relume_cli.options import Data
from relume_cli.terminal.printing import Json, print_result

if TYPE_CHECKING:
    from relume.assets.btf.btf_store import BtfRecord
    from relume.assets.measured.measured_store import MaterialRecord
    from relume_cli.database.actions import OpenFolder

Kind = Literal[
    "scene", "bake", "look", "environment", "material", "image", "ies", "lut", "render", "comparison", "btf-job"
]


class Deletable(NamedTuple):
    """Something to delete: its id, a label for questions, and the function that deletes it."""

    id: str
    label: str
    delete: Callable[[], object]


def delete(
    kind: Annotated[Kind, typer.Argument(metavar="KIND", help="What to delete; a scene is deleted with its bakes.")],
    names: Annotated[list[str], typer.Argument(metavar="NAME…", help="Ids or names from relume list.")],
    yes: Annotated[bool, typer.Option("--yes", help="Delete without asking.")] = False,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Delete scenes, bakes, looks, assets or jobs.

    A server need not stop: sessions that show a deleted bake end with a message. Looks that use a deleted environment,
    material, image, IES file or LUT are no longer valid. An image is deleted with those that are derived from it.
    """
    from relume_cli.database.actions import open_data_folder
    from relume_cli.tokens import audit_change

    with open_data_folder(data) as data_folder:
        deletables = list(
            {deletable.id: deletable for deletable in (FINDERS[kind](data_folder, name) for name in names)}.values()
        )
        _confirm(deletables, yes)
        for deletable in deletables:
            deletable.delete()
            audit_change(data_folder.access, f"delete {kind}", deletable.id)
            print_result({"kind": kind, "id": deletable.id}, deletable.id, as_json=as_json)


def _confirm(deletables: list[Deletable], yes: bool) -> None:
    from relume.core.errors import PlanError

    labels = ", ".join(deletable.label for deletable in deletables)
    if yes:
        return
    if not sys.stdin.isatty():
        raise PlanError(f"there is no terminal to ask at; give --yes to delete {labels}")
    typer.confirm(f"Delete {labels}?", abort=True, err=True)


def _scene(data_folder: OpenFolder, name: str) -> Deletable:
    from relume_cli.data_folder import find_scene
    from relume_server.persistence.comment_store import CommentStore
    from relume_worker.scenes import delete_scene

    ledger = data_folder.service.ledger
    scene = find_scene(ledger, name)
    bakes = [bake.id for bake in data_folder.service.bakes(scene.id)]

    def remove() -> None:
        delete_scene(data_folder.service.data_dir, ledger, scene.id)
        CommentStore(ledger.sessions).delete_scene(scene.id)
        data_folder.access.quotas.disown("scene", scene.id)
        data_folder.access.quotas.disown("bake", *bakes)

    return Deletable(scene.id, f"scene {scene.id} ({scene.name}) with {len(bakes)} bakes", remove)


def _bake(data_folder: OpenFolder, name: str) -> Deletable:
    """A bake by its id only: a scene may have several bakes."""
    from relume.core.errors import NotFoundError
    from relume_cli.database.actions import find_bakes
    from relume_cli.terminal.documents import recipe_text

    bakes = find_bakes(data_folder.service, name)
    if len(bakes) > 1:
        raise NotFoundError(f"{name!r} has {len(bakes)} bakes; give one of {', '.join(bake.id for bake in bakes[:10])}")

    def remove() -> None:
        data_folder.service.delete(bakes[0].id)
        data_folder.access.quotas.disown("bake", bakes[0].id)

    return Deletable(bakes[0].id, f"bake {bakes[0].id} ({recipe_text(bakes[0].recipe)})", remove)


def _look(data_folder: OpenFolder, name: str) -> Deletable:
    from relume_cli.name_lookup import pick
    from relume_server.persistence.look_store import LookStore

    store = LookStore(data_folder.service.ledger.sessions)
    look_name = pick("look", name, [(look.name, look.name) for look in store.list()], "save looks in the editor")
    etag = store.get(look_name).etag
    return Deletable(look_name, f"look {look_name!r}", lambda: store.delete(look_name, etag))


def _small_asset(kind: SmallAssetKind, hint: str) -> Callable[[OpenFolder, str], Deletable]:
    """Return a function that finds an asset. hint: what to do if there is none."""

    def find(data_folder: OpenFolder, name: str) -> Deletable:
        from relume_cli.name_lookup import pick

        store, folder_of, _ = small_assets(kind)
        folder = folder_of(data_folder.settings.data)
        names = {record.id: record.name for record in store.list_records(folder)}
        identity = pick(store.label, name.removeprefix(store.prefix), list(names.items()), hint)

        def remove() -> None:
            store.remove(folder, identity)
            data_folder.access.quotas.disown(kind, identity)

        return Deletable(identity, f"{store.label} {identity} ({names[identity]})", remove)

    return find


def _material(data_folder: OpenFolder, name: str) -> Deletable:
    from relume.assets.btf import btf_store
    from relume.assets.measured import measured_store
    from relume_cli.name_lookup import pick
    from relume_worker.paths import btfs_path, materials_path

    measured, btfs = materials_path(data_folder.settings.data), btfs_path(data_folder.settings.data)
    records: list[MaterialRecord | BtfRecord] = [*measured_store.records(measured), *btf_store.records(btfs)]
    names = {record.data: record.name for record in records}
    material = pick("measured material or BTF", name, list(names.items()), "fits of the library cannot be deleted")

    def remove() -> None:
        if material.startswith(btf_store.STORE.prefix):
            identity = material.removeprefix(btf_store.STORE.prefix)
            btf_store.STORE.remove(btfs, identity)
            data_folder.access.quotas.disown("btf", identity)
        else:
            identity = material.removeprefix(measured_store.STORE.prefix)
            measured_store.STORE.remove(measured, identity)
            data_folder.access.quotas.disown("material", identity)

    return Deletable(material, f"material {material} ({names[material]})", remove)


def _image(data_folder: OpenFolder, name: str) -> Deletable:
    from relume.brdf.texture_slots import IMAGES
    from relume.images.image_store import records
    from relume_cli.name_lookup import pick
    from relume_worker.paths import images_path

    folder = images_path(data_folder.settings.data)
    images = records(folder)
    names = {record.texture: record.name for record in images}
    texture = pick("image", name, list(names.items()), "upload images in the editor")
    derived = [record.texture for record in images if record.recipe and texture in record.recipe.images]

    def remove() -> None:
        for each in (*derived, texture):
            identity = each.removeprefix(IMAGES.prefix)
            IMAGES.remove(folder, identity)
            data_folder.access.quotas.disown("image", identity)

    return Deletable(texture, f"image {texture} ({names[texture]})", remove)


def _job(noun: str) -> Callable[[OpenFolder, str], Deletable]:
    def find(data_folder: OpenFolder, name: str) -> Deletable:
        from relume_cli.database.jobs import delete_job, find_job

        identity = find_job(data_folder, noun, name).id
        return Deletable(identity, f"{noun} {identity}", lambda: delete_job(data_folder, noun, identity))

    return find


FINDERS: dict[Kind, Callable[[OpenFolder, str], Deletable]] = {
    "scene": _scene,
    "bake": _bake,
    "look": _look,
    "environment": _small_asset("environment", "built-in environments cannot be deleted"),
    "material": _material,
    "image": _image,
    "ies": _small_asset("ies", "upload IES files in the editor"),
    "lut": _small_asset("lut", "upload LUTs in the editor"),
    "render": _job("render"),
    "comparison": _job("comparison"),
    "btf-job": _job("btf-job"),
}
