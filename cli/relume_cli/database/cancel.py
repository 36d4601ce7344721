"""`relume cancel`: cancel queued and running bakes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from relume_cli.options import Data
from relume_cli.terminal.printing import Json, note, print_result

if TYPE_CHECKING:
    from relume_worker.status import BakeStatus


def cancel(
    bakes: Annotated[
        list[str], typer.Argument(metavar="BAKE…", help="Ids of bakes, or a scene for all of its unfinished bakes.")
    ],
    as_json: Json = False,
    data: Data = None,
) -> int:
    """Cancel queued and running bakes, on any machine.

    Finished tasks are saved: the same relume bake resumes. Fails if a bake had already ended.
    """
    from relume_cli.database.actions import find_bakes, open_data_folder
    from relume_cli.terminal.documents import bake_document
    from relume_cli.tokens import audit_change

    has_failed = False
    with open_data_folder(data) as data_folder:
        selected = {bake.id: bake for name in bakes for bake in _select_active(find_bakes(data_folder.service, name))}
        for bake in selected.values():
            if data_folder.service.cancel(bake.id):
                audit_change(data_folder.access, "cancel bake", bake.id)
                print_result(
                    bake_document(data_folder.service.get(bake.id), data_folder.service), bake.id, as_json=as_json
                )
            elif bake.state != "canceled":
                has_failed = True
                typer.echo(
                    f"relume: bake {bake.id} is {data_folder.service.get(bake.id).state}; nothing to cancel", err=True
                )
            else:
                note(f"bake {bake.id} is already canceled")
    return 1 if has_failed else 0


def _select_active(bakes: list[BakeStatus]) -> list[BakeStatus]:
    """The unfinished bakes; if there are none, the newest one."""
    return [bake for bake in bakes if not bake.final] or bakes[:1]
