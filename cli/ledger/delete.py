"""`relume delete`: scenes, bakes, looks and environments that nobody needs any more."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import typer

from cli.options import Data
from cli.terminal.printing import Json, print_result

if TYPE_CHECKING:
    from cli.ledger.acting import Opened

Kind = Literal["scene", "bake", "look", "environment"]


class Deletable(NamedTuple):
    """One thing that is to be deleted: what names it, in words, and how."""

    id: str
    words: str
    delete: Callable[[], object]


def delete(
    kind: Annotated[Kind, typer.Argument(metavar="KIND", help="What it is; a scene goes with its bakes.")],
    names: Annotated[list[str], typer.Argument(metavar="NAME…", help="Ids or names, as relume list shows them.")],
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask.")] = False,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Delete scenes, bakes, looks or environments.

    A server may go on; sessions that show a bake which is deleted are told, and end. Looks that name an environment
    which is deleted are refused from then on.
    """
    from cli.ledger.acting import opened
    from cli.tokens import write_down

    with opened(data) as there:
        things = list({thing.id: thing for thing in (FIND[kind](there, name) for name in names)}.values())
        _confirm(things, yes)
        for thing in things:
            thing.delete()
            write_down(there.access, f"delete {kind}", thing.id)
            print_result({"kind": kind, "id": thing.id}, thing.id, as_json=as_json)


def _confirm(things: list[Deletable], yes: bool) -> None:
    from relume.errors import PlanError

    words = ", ".join(thing.words for thing in things)
    if yes:
        return
    if not sys.stdin.isatty():
        raise PlanError(f"there is no terminal to ask at; give --yes to delete {words}")
    typer.confirm(f"Delete {words}?", abort=True, err=True)


def _scene(there: Opened, name: str) -> Deletable:
    from cli.data_folder import find_scene
    from server.records.comments import CommentStore
    from worker.scenes import delete_scene

    ledger = there.service.ledger
    scene = find_scene(ledger, name)
    bakes = [one.id for one in there.service.bakes(scene.id)]

    def remove() -> None:
        delete_scene(there.service.data_dir, ledger, scene.id)
        CommentStore(ledger.sessions).forget(scene.id)
        there.access.quotas.disown("scene", scene.id)
        there.access.quotas.disown("bake", *bakes)

    return Deletable(scene.id, f"scene {scene.id} ({scene.name}) with {len(bakes)} bakes", remove)


def _bake(there: Opened, name: str) -> Deletable:
    """By its id alone: of the bakes of a scene none is meant more than another."""
    from cli.ledger.acting import find_bakes
    from cli.terminal.documents import recipe_text
    from relume.errors import NotFoundError

    found = find_bakes(there.service, name)
    if len(found) > 1:
        raise NotFoundError(f"{name!r} has {len(found)} bakes; give one of {', '.join(one.id for one in found[:10])}")

    def remove() -> None:
        there.service.forget(found[0].id)
        there.access.quotas.disown("bake", found[0].id)

    return Deletable(found[0].id, f"bake {found[0].id} ({recipe_text(found[0].recipe)})", remove)


def _look(there: Opened, name: str) -> Deletable:
    from cli.naming import pick
    from server.records.looks import LookStore

    store = LookStore(there.service.ledger.sessions)
    called = pick("look", name, [(look.name, look.name) for look in store.list()], "looks are saved in the editor")
    etag = store.get(called).etag
    return Deletable(called, f"look {called!r}", lambda: store.delete(called, etag))


def _environment(there: Opened, name: str) -> Deletable:
    from cli.naming import pick
    from relume.environments.asset_store import STORE, records
    from worker.paths import environments_path

    folder = environments_path(there.settings.data)
    known = [(record.id, record.name) for record in records(folder)]
    called = pick("imported environment", name.removeprefix(STORE.prefix), known, "built-in ones stay")

    def remove() -> None:
        STORE.remove(folder, called)
        there.access.quotas.disown("environment", called)

    return Deletable(called, f"environment {called} ({dict(known)[called]})", remove)


FIND: dict[Kind, Callable[[Opened, str], Deletable]] = {
    "scene": _scene,
    "bake": _bake,
    "look": _look,
    "environment": _environment,
}
