"""`relume list`: list scenes, bakes, looks, assets and jobs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from relume_cli.database.jobs import list_jobs
from relume_cli.database.small_assets import SmallAssetKind, small_assets
from relume_cli.options import Data
from relume_cli.terminal.printing import Json, iso_time, print_result

if TYPE_CHECKING:
    from relume.assets.btf.btf_store import BtfRecord
    from relume.assets.measured.measured_store import MaterialRecord
    from relume_cli.database.actions import OpenFolder

Kind = Literal[
    "scenes",
    "bakes",
    "looks",
    "environments",
    "materials",
    "images",
    "ies",
    "luts",
    "renders",
    "comparisons",
    "btf-jobs",
    "built-ins",
]
JOB_KINDS = ("renders", "comparisons", "btf-jobs")
Row = tuple[dict[str, Any], str]
"""An entry as JSON, and as a line that begins with its name or id."""


def list_items(
    kind: Annotated[Kind, typer.Argument(metavar="KIND", help="What to list.", show_default=True)] = "scenes",
    scene: Annotated[str | None, typer.Option("--scene", metavar="SCENE", help="Only bakes of this scene.")] = None,
    state: Annotated[
        str | None, typer.Option("--state", metavar="STATE", help="Only bakes or jobs in this state.")
    ] = None,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """List scenes, bakes, looks, assets and jobs.

    Newest first. Each line begins with the id or name that other commands accept.
    """
    from relume.core.errors import ParameterError
    from relume_cli.database.actions import open_data_folder

    if scene is not None and kind != "bakes":
        raise ParameterError("--scene", scene, f"no scene, because {kind} have none")
    if state is not None and kind not in ("bakes", *JOB_KINDS):
        raise ParameterError("--state", state, f"no state, because {kind} have none")
    if kind == "built-ins":
        rows = _built_ins()
    elif kind == "bakes":
        with open_data_folder(data) as data_folder:
            rows = list(_bakes(data_folder, scene, state))
    else:
        with open_data_folder(data) as data_folder:
            rows = [row for row in LISTS[kind](data_folder) if state in (None, row[0].get("state"))]
    for document, line in rows:
        print_result(document, line, as_json=as_json)


def _scenes(data_folder: OpenFolder) -> Iterator[Row]:
    from relume_cli.terminal.documents import scene_document
    from relume_worker.scenes import list_scenes

    bakes = data_folder.service.bakes()
    for record in list_scenes(data_folder.service.ledger):
        scene_bakes = [status for status in bakes if status.scene == record.id]
        line = f"{record.id}  {record.num_triangles:>10,} triangles  {len(scene_bakes):>3} bakes  {record.name}"
        yield scene_document(record, scene_bakes), line


def _bakes(data_folder: OpenFolder, scene: str | None, state: str | None) -> Iterator[Row]:
    from relume_cli.data_folder import find_scene
    from relume_cli.terminal.documents import bake_document, recipe_text
    from relume_worker.scenes import list_scenes

    names = {record.id: record.name for record in list_scenes(data_folder.service.ledger)}
    scene_id = None if scene is None else find_scene(data_folder.service.ledger, scene).id
    for status in data_folder.service.bakes(scene_id):
        if state in (None, status.state):
            name = names.get(status.scene, status.scene)
            line = f"{status.id}  {status.state:9}  {status.progress:>4.0%}  {name}: {recipe_text(status.recipe)}"
            yield bake_document(status, data_folder.service), line


def _looks(data_folder: OpenFolder) -> Iterator[Row]:
    from relume_server.persistence.look_store import LookStore

    for look in LookStore(data_folder.service.ledger.sessions).list():
        modified = iso_time(look.modified)
        times = {"created": iso_time(look.created), "modified": modified}
        document = {"name": look.name, "etag": look.etag, **times, "bytes": look.num_bytes}
        yield document, f"{look.name}  {modified[:16]}"


def _environments(data_folder: OpenFolder) -> Iterator[Row]:
    from relume.assets.environments.built_in import BUILT_IN

    for name, (label, _) in BUILT_IN.items():
        yield {"id": name, "map": name, "name": label, "created": None, "warnings": []}, f"{name:20}  {label}"
    yield from _small_assets("environment", data_folder)


def _small_assets(kind: SmallAssetKind, data_folder: OpenFolder) -> Iterator[Row]:
    assets = small_assets(kind)
    for record in assets.store.list_records(assets.folder(data_folder.settings.data)):
        yield assets.document(record), f"{record.reference:20}  {record.name}"


def _materials(data_folder: OpenFolder) -> Iterator[Row]:
    from relume.assets.btf import btf_store
    from relume.assets.measured import measured_store
    from relume.imported_materials import material_store
    from relume_worker.paths import btfs_path, imported_materials_path, materials_path

    material_records: list[MaterialRecord | BtfRecord] = [
        *measured_store.records(materials_path(data_folder.settings.data)),
        *btf_store.records(btfs_path(data_folder.settings.data)),
    ]
    for record in material_records:
        created, terms = iso_time(record.created), record.terms()
        document = {"id": record.id, "data": record.data, "name": record.name, "created": created, "terms": terms}
        yield document, f"{record.data:21}  {record.name}"
    for imported in material_store.records(imported_materials_path(data_folder.settings.data)):
        names = [material.name for material in imported.materials]
        document = {"id": imported.id, "name": imported.name, "created": iso_time(imported.created), "materials": names}
        yield document, f"{imported.id:21}  {imported.name}: {', '.join(names)}"


def _images(data_folder: OpenFolder) -> Iterator[Row]:
    from relume.images.image_store import records
    from relume_worker.paths import images_path

    for record in records(images_path(data_folder.settings.data)):
        document = {
            "id": record.id,
            "texture": record.texture,
            "name": record.name,
            "created": iso_time(record.created),
        }
        yield document, f"{record.texture:22}  {record.name}"


def _built_ins() -> list[Row]:
    from relume.scene.examples.catalog import BUILT_IN

    return [({"name": name, "label": entry.label}, f"{name:22}  {entry.label}") for name, entry in BUILT_IN.items()]


LISTS: dict[str, Callable[[OpenFolder], Iterator[Row]]] = {
    "scenes": _scenes,
    "looks": _looks,
    "environments": _environments,
    "materials": _materials,
    "images": _images,
    "ies": partial(_small_assets, "ies"),
    "luts": partial(_small_assets, "lut"),
    "renders": partial(list_jobs, noun="render"),
    "comparisons": partial(list_jobs, noun="comparison"),
    "btf-jobs": partial(list_jobs, noun="btf-job"),
}
