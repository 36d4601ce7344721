"""`relume cancel`: cancel queued and running bakes and jobs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from relume_cli.options import Data
from relume_cli.terminal.printing import Json, note, print_result

if TYPE_CHECKING:
    from relume_cli.database.actions import OpenFolder
    from relume_worker.status import BakeStatus


class Cancelable(NamedTuple):
    """Something to cancel: its noun in messages, its id, and its state when it was found."""

    noun: str
    id: str
    state: str


def cancel(
    names: Annotated[
        list[str],
        typer.Argument(metavar="ID…", help="Ids of bakes or jobs, or a scene for all of its unfinished bakes."),
    ],
    as_json: Json = False,
    data: Data = None,
) -> int:
    """Cancel bakes, renders, comparisons and BTF jobs.

    Finished tasks are saved: the same relume bake resumes. Fails if one had already ended.
    """
    from relume_cli.database.actions import open_data_folder
    from relume_cli.terminal.documents import bake_document
    from relume_cli.tokens import audit_change

    has_failed = False
    with open_data_folder(data) as data_folder:
        selected = {each.id: each for name in names for each in _select(data_folder, name)}
        for identity, (noun, _, state) in selected.items():
            if data_folder.service.jobs.ledger.cancel(identity):
                audit_change(data_folder.access, f"cancel {noun}", identity)
                document: dict[str, Any] = {"kind": noun, "id": identity, "state": "canceled"}
                if noun == "bake":
                    document = bake_document(data_folder.service.get(identity), data_folder.service)
                print_result(document, identity, as_json=as_json)
            elif state != "canceled":
                has_failed = True
                typer.echo(f"relume: {noun} {identity} is {state}; nothing to cancel", err=True)
            else:
                note(f"{noun} {identity} is already canceled")
    return 1 if has_failed else 0


def _select(data_folder: OpenFolder, name: str) -> list[Cancelable]:
    from relume_cli.database.actions import find_bakes
    from relume_cli.database.jobs import find_any_job

    if (job := find_any_job(data_folder, name)) is not None:
        noun, row = job
        return [Cancelable(noun, row.id, row.state)]
    return [Cancelable("bake", bake.id, bake.state) for bake in _select_active(find_bakes(data_folder.service, name))]


def _select_active(bakes: list[BakeStatus]) -> list[BakeStatus]:
    """The unfinished bakes; if there are none, the newest one."""
    return [bake for bake in bakes if not bake.final] or bakes[:1]
